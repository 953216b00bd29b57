// Files, attributes, and data sets of text; those of numbers are in hdf5_rows.cpp.

#include "io/hdf5.hpp"

#include <fcntl.h>
#include <hdf5.h>
#include <hdf5_hl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <numeric>

#include "io/files.hpp"
#include "io/hdf5_types.hpp"

namespace pendula::io::hdf5 {
namespace {

/// Why a call failed: the error of the system, if known, else the message of the deepest HDF5 call.
std::string reason() {
  switch (errno) {
    case ENOSPC:
    case EFBIG:
    case EDQUOT:
    case EIO:
      return std::strerror(errno);
    default:
      break;
  }
  std::string deepest = "an error of HDF5";
  H5Ewalk2(
      H5E_DEFAULT, H5E_WALK_DOWNWARD,
      [](unsigned, const H5E_error2_t* error, void* text) -> herr_t {
        if (error->desc != nullptr) *static_cast<std::string*>(text) = error->desc;
        return 0;
      },
      &deepest);
  return deepest;
}

/// The file format of HDF5 1.10, which can be read while it is written; the oldest supported HDF5 reads it.
Handle file_access() {
  Handle access = property_list(H5P_FILE_ACCESS);
  require(H5Pset_libver_bounds(access.get(), H5F_LIBVER_V110, H5F_LIBVER_V110));
  require(H5Pset_fclose_degree(access.get(), H5F_CLOSE_STRONG));
  return access;
}

// Parts of the file point beyond the end in the superblock until the superblock is written, last. So the file gets its
// new length, and the superblock its new end, before the flush.
void make_room(const Handle& file, const std::string& name) {
  hsize_t wanted = 0;
  struct stat status {};
  const Descriptor descriptor(open(name.c_str(), O_RDWR | O_CLOEXEC));
  if (descriptor.get() < 0 || fstat(descriptor.get(), &status) != 0) return;
  if (H5Fget_filesize(file.get(), &wanted) < 0 || static_cast<hsize_t>(status.st_size) > wanted) return;
  if (ftruncate(descriptor.get(), static_cast<off_t>(wanted)) == 0) mark_as_closed(name);
}

}  // namespace

Error::Error() : std::runtime_error(reason()) {}

void begin() {
  H5dont_atexit();  // otherwise it would close files again at exit, and complain if the disk is full
  require(H5open());
  require(H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr));
}

Handle create_file(const std::string& file) {
  const Handle properties = property_list(H5P_FILE_CREATE);
  require(H5Pset_link_creation_order(properties.get(), H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED));
  errno = 0;
  return {H5Fcreate(file.c_str(), H5F_ACC_TRUNC, properties.get(), file_access().get()), H5Fclose};
}

Handle open_file(const std::string& file) {
  errno = 0;
  // HDF5 reads a part again if its checksum does not match, after a pause that doubles each time: 2¹⁶ ns in all here.
  // Its default would take longer than a lifetime.
  constexpr unsigned attempts = 16;
  const Handle access = file_access();
  require(H5Pset_metadata_read_attempts(access.get(), attempts));
  return {H5Fopen(file.c_str(), H5F_ACC_RDONLY | H5F_ACC_SWMR_READ, access.get()), H5Fclose};
}

void let_others_read(const Handle& file) {
  require(H5Fstart_swmr_write(file.get()));
}

void flush(const Handle& file, const std::string& name) {
  make_room(file, name);
  errno = 0;
  require(H5Fflush(file.get(), H5F_SCOPE_GLOBAL));
  mark_as_closed(name);
}

Handle create_group(const Handle& where, const std::string& name) {
  return {H5Gcreate2(where.get(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose};
}

Handle open_group(const Handle& where, const std::string& name) {
  return {H5Gopen2(where.get(), name.c_str(), H5P_DEFAULT), H5Gclose};
}

bool has(const Handle& where, const std::string& name) {
  return require(H5Lexists(where.get(), name.c_str(), H5P_DEFAULT)) > 0;
}

Handle create_numbering(const Handle& where, const std::string& name, std::size_t count) {
  const std::array<hsize_t, 1> extent{count};
  const Handle space = space_of(extent);
  Handle dataset = create_dataset(where, name, H5T_STD_I32LE, space);
  std::vector<int> numbers(count);
  std::iota(numbers.begin(), numbers.end(), 1);
  require(H5Dwrite(dataset.get(), H5T_NATIVE_INT, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()));
  return dataset;
}

Handle create_number(const Handle& where, const std::string& name, double number) {
  const Handle space = single_space();
  Handle dataset = create_dataset(where, name, H5T_IEEE_F64LE, space);
  require(H5Dwrite(dataset.get(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, &number));
  return dataset;
}

Handle create_vector(const Handle& where, const std::string& name, std::span<const double> numbers) {
  const std::array<hsize_t, 1> extent{numbers.size()};
  const Handle space = space_of(extent);
  Handle dataset = create_dataset(where, name, H5T_IEEE_F64LE, space);
  require(H5Dwrite(dataset.get(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()));
  return dataset;
}

Handle create_texts(const Handle& where, const std::string& name, std::span<const std::string> texts) {
  const std::array<hsize_t, 1> extent{texts.size()};
  const Handle space = space_of(extent), type = text_type();
  Handle dataset = create_dataset(where, name, type.get(), space);
  std::vector<const char*> begins;
  for (const std::string& text : texts) begins.push_back(text.c_str());
  require(H5Dwrite(dataset.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, begins.data()));
  return dataset;
}

Handle create_array(const Handle& where, const std::string& name, std::span<const std::int64_t> extent, Type type) {
  const std::vector<hsize_t> sizes(extent.begin(), extent.end());
  const Handle space = space_of(sizes), properties = property_list(H5P_DATASET_CREATE);
  require(H5Pset_alloc_time(properties.get(), H5D_ALLOC_TIME_EARLY));
  set_fill(properties, type);
  errno = 0;
  return create_dataset(where, name, stored_as(type), space, properties);
}

std::uint64_t offset_of(const Handle& array) {
  const haddr_t offset = H5Dget_offset(array.get());
  if (offset == HADDR_UNDEF) throw Error();
  return offset;
}

void make_scale(const Handle& dataset, const std::string& name) {
  require(H5DSset_scale(dataset.get(), name.c_str()));
}

void attach_scale(const Handle& dataset, const Handle& scale, unsigned axis) {
  require(H5DSattach_scale(dataset.get(), scale.get(), axis));
}

Handle open_dataset(const Handle& where, const std::string& name) {
  return {H5Dopen2(where.get(), name.c_str(), H5P_DEFAULT), H5Dclose};
}

Handle property_list(hid_t of) {
  return {H5Pcreate(of), H5Pclose};
}

Handle text_type() {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  require(H5Tset_size(type.get(), H5T_VARIABLE));
  require(H5Tset_cset(type.get(), H5T_CSET_UTF8));
  return type;
}

Handle space_of(std::span<const hsize_t> extent, const hsize_t* most) {
  return {H5Screate_simple(static_cast<int>(extent.size()), extent.data(), most), H5Sclose};
}

Handle single_space() {
  return {H5Screate(H5S_SCALAR), H5Sclose};
}

hid_t stored_as(Type type) {
  return type == Type::real ? H5T_IEEE_F64LE : type == Type::whole ? H5T_STD_I64LE : H5T_STD_I8LE;
}

void set_fill(const Handle& properties, Type type) {
  const double none = std::nan("");
  const std::int64_t no_count = -1;
  require(type == Type::real ? H5Pset_fill_value(properties.get(), H5T_NATIVE_DOUBLE, &none)
                             : H5Pset_fill_value(properties.get(), H5T_NATIVE_INT64, &no_count));
}

std::string taken(char* text) {
  std::string copy(text == nullptr ? "" : text);
  H5free_memory(text);
  return copy;
}

Handle create_dataset(const Handle& where, const std::string& name, hid_t type, const Handle& space,
                      const Handle& properties) {
  const hid_t chosen = properties.get() < 0 ? H5P_DEFAULT : properties.get();
  return {H5Dcreate2(where.get(), name.c_str(), type, space.get(), H5P_DEFAULT, chosen, H5P_DEFAULT), H5Dclose};
}

namespace {

/// Replaces an attribute of the same name.
Handle create_attribute(const Handle& object, const std::string& name, hid_t type, const Handle& space) {
  if (H5Aexists(object.get(), name.c_str()) > 0) require(H5Adelete(object.get(), name.c_str()));
  return {H5Acreate2(object.get(), name.c_str(), type, space.get(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose};
}

}  // namespace

void write_attribute(const Handle& object, const std::string& name, const std::string& text) {
  const Handle type = text_type();
  const char* const begin = text.c_str();
  const Handle attribute = create_attribute(object, name, type.get(), single_space());
  require(H5Awrite(attribute.get(), type.get(), &begin));
}

void write_attribute(const Handle& object, const std::string& name, std::int64_t number) {
  const Handle attribute = create_attribute(object, name, H5T_STD_I64LE, single_space());
  require(H5Awrite(attribute.get(), H5T_NATIVE_INT64, &number));
}

bool has_attribute(const Handle& object, const std::string& name) {
  return H5Aexists(object.get(), name.c_str()) > 0;
}

std::string read_attribute(const Handle& object, const std::string& name) {
  const Handle attribute(H5Aopen(object.get(), name.c_str(), H5P_DEFAULT), H5Aclose);
  char* text = nullptr;
  require(H5Aread(attribute.get(), text_type().get(), &text));
  return taken(text);
}

std::int64_t read_number(const Handle& object, const std::string& name) {
  const Handle attribute(H5Aopen(object.get(), name.c_str(), H5P_DEFAULT), H5Aclose);
  std::int64_t number = 0;
  require(H5Aread(attribute.get(), H5T_NATIVE_INT64, &number));
  return number;
}

void write_text(const Handle& where, const std::string& name, const std::string& text) {
  const Handle type = text_type(), space = single_space();
  const Handle dataset = create_dataset(where, name, type.get(), space);
  const char* const begin = text.c_str();
  require(H5Dwrite(dataset.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, &begin));
}

std::string read_text(const Handle& where, const std::string& name) {
  const Handle dataset = open_dataset(where, name);
  char* text = nullptr;
  require(H5Dread(dataset.get(), text_type().get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, &text));
  return taken(text);
}

void write_flags(const Handle& array, Type type, int first, std::span<const std::string> meanings) {
  std::vector<int> values(meanings.size());
  std::iota(values.begin(), values.end(), first);
  std::string words;
  for (const std::string& meaning : meanings) words += (words.empty() ? "" : " ") + meaning;
  const std::array<hsize_t, 1> extent{values.size()};
  const Handle attribute = create_attribute(array, "flag_values", stored_as(type), space_of(extent));
  require(H5Awrite(attribute.get(), H5T_NATIVE_INT, values.data()));
  write_attribute(array, "flag_meanings", words);
}

}  // namespace pendula::io::hdf5
