// Files, attributes, and data sets of text; hdf5_tables.cpp has those of numbers.

#include "io/hdf5.hpp"

#include <fcntl.h>
#include <hdf5.h>
#include <hdf5_hl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
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
  // The default would take longer than a lifetime.
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

// The superblock of a file: it says whether somebody has the file open, and where it ends.
namespace {

/// Checksum of the superblock: Bob Jenkins' lookup3.
std::uint32_t checksum(std::span<const unsigned char> bytes) {
  const auto rotated = [](std::uint32_t x, int by) { return (x << by) | (x >> (32 - by)); };
  std::uint32_t a = 0xdeadbeef + static_cast<std::uint32_t>(bytes.size()), b = a, c = a;
  std::array<unsigned char, 12> block{};
  while (!bytes.empty()) {
    const std::size_t taken = std::min<std::size_t>(bytes.size(), block.size());
    block.fill(0);
    std::copy_n(bytes.begin(), taken, block.begin());
    bytes = bytes.subspan(taken);
    const auto word = [&](std::size_t at) {
      return static_cast<std::uint32_t>(block[at]) | static_cast<std::uint32_t>(block[at + 1]) << 8 |
             static_cast<std::uint32_t>(block[at + 2]) << 16 | static_cast<std::uint32_t>(block[at + 3]) << 24;
    };
    a += word(0), b += word(4), c += word(8);
    if (!bytes.empty()) {
      a -= c, a ^= rotated(c, 4), c += b;
      b -= a, b ^= rotated(a, 6), a += c;
      c -= b, c ^= rotated(b, 8), b += a;
      a -= c, a ^= rotated(c, 16), c += b;
      b -= a, b ^= rotated(a, 19), a += c;
      c -= b, c ^= rotated(b, 4), b += a;
    } else {
      c ^= b, c -= rotated(b, 14);
      a ^= c, a -= rotated(c, 11);
      b ^= a, b -= rotated(a, 25);
      c ^= b, c -= rotated(b, 16);
      a ^= c, a -= rotated(c, 4);
      b ^= a, b -= rotated(a, 14);
      c ^= b, c -= rotated(b, 24);
    }
  }
  return c;
}

std::uint64_t number_in(std::span<const unsigned char> bytes) {
  std::uint64_t number = 0;
  for (std::size_t k = bytes.size(); k-- > 0;) number = number << 8 | bytes[k];
  return number;
}
void put_number(std::uint64_t number, std::span<unsigned char> bytes) {
  for (unsigned char& byte : bytes) {
    byte = static_cast<unsigned char>(number);
    number >>= 8;
  }
}

}  // namespace

// Superblock version 3, bytes: signature (8), version (1), sizes (2), flags (1), four addresses (32; the third is the
// end of the file), checksum (4).
void mark_as_closed(const std::string& file) {
  constexpr std::size_t version_at = 8, flags_at = 11, end_at = 28, checksum_at = 44;
  std::array<unsigned char, 48> block{};
  struct stat status {};
  const Descriptor descriptor(open(file.c_str(), O_RDWR | O_CLOEXEC));
  if (descriptor.get() < 0 || pread(descriptor.get(), block.data(), block.size(), 0) != ssize_t{48}) return;
  if (block[version_at] != 3 || fstat(descriptor.get(), &status) != 0) return;
  const std::array<unsigned char, 48> before = block;
  block[flags_at] = 0;
  const auto end = static_cast<std::uint64_t>(status.st_size);
  if (number_in(std::span(block).subspan(end_at, 8)) < end) put_number(end, std::span(block).subspan(end_at, 8));
  if (block == before) return;
  put_number(checksum(std::span(block).first(checksum_at)), std::span(block).subspan(checksum_at, 4));
  if (pwrite(descriptor.get(), block.data(), block.size(), 0) != ssize_t{48}) return;  // the mark stays: harmless
}

}  // namespace pendula::io::hdf5
