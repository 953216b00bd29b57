#include "io/hdf5.hpp"

#include <fcntl.h>
#include <hdf5.h>
#include <hdf5_hl.h>
#include <isa-l/igzip_lib.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <numeric>

namespace pendula::io::hdf5 {
namespace {

/// Why a call failed: the message of the deepest call, or what the system said where that is known.
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

Handle property_list(hid_t of) {
  return {H5Pcreate(of), H5Pclose};
}

/// The newest format that the oldest library here reads: the one that others can read while it is written.
Handle file_access() {
  Handle access = property_list(H5P_FILE_ACCESS);
  require(H5Pset_libver_bounds(access.get(), H5F_LIBVER_V110, H5F_LIBVER_V110));
  require(H5Pset_fclose_degree(access.get(), H5F_CLOSE_STRONG));
  return access;
}

Handle text_type() {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  require(H5Tset_size(type.get(), H5T_VARIABLE));
  require(H5Tset_cset(type.get(), H5T_CSET_UTF8));
  return type;
}

/// Of a length that every text has, with zeros at its end.
Handle padded_text_type(std::size_t room) {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  require(H5Tset_size(type.get(), room));
  require(H5Tset_strpad(type.get(), H5T_STR_NULLPAD));
  require(H5Tset_cset(type.get(), H5T_CSET_UTF8));
  return type;
}

/// A text that the library has read, and given away.
std::string taken(char* text) {
  std::string copy(text == nullptr ? "" : text);
  H5free_memory(text);
  return copy;
}

Handle space_of(std::span<const hsize_t> extent, const hsize_t* most = nullptr) {
  return {H5Screate_simple(static_cast<int>(extent.size()), extent.data(), most), H5Sclose};
}

/// In place of one that is there.
Handle create_attribute(const Handle& object, const std::string& name, hid_t type, const Handle& space) {
  if (H5Aexists(object.get(), name.c_str()) > 0) require(H5Adelete(object.get(), name.c_str()));
  return {H5Acreate2(object.get(), name.c_str(), type, space.get(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose};
}

hid_t stored_as(Type type) {
  return type == Type::real ? H5T_IEEE_F64LE : type == Type::whole ? H5T_STD_I64LE : H5T_STD_I8LE;
}

/// What an array of that type has where nothing was written: NaN, or −1.
void set_fill(const Handle& properties, Type type) {
  const double none = std::nan("");
  const std::int64_t no_count = -1;
  require(type == Type::real ? H5Pset_fill_value(properties.get(), H5T_NATIVE_DOUBLE, &none)
                             : H5Pset_fill_value(properties.get(), H5T_NATIVE_INT64, &no_count));
}

/// Rows of `size` numbers, or numbers where that is 0, without an end, in chunks.
Handle growing_space(std::size_t size) {
  const std::array<hsize_t, 2> extent{0, size}, most{H5S_UNLIMITED, size};
  return space_of(std::span(extent).first(size == 0 ? 1 : 2), most.data());
}
Handle growing_properties(std::size_t size, std::size_t chunk_rows) {
  const std::array<hsize_t, 2> chunk{chunk_rows, size};
  Handle properties = property_list(H5P_DATASET_CREATE);
  require(H5Pset_chunk(properties.get(), size == 0 ? 1 : 2, chunk.data()));
  return properties;
}

/// Bytes of one significance after the other: those of the same end are alike, and pack well.
void shuffle(std::span<const double> numbers, std::vector<unsigned char>& bytes) {
  const std::size_t count = numbers.size();
  bytes.resize(8 * count);
  for (std::size_t significance = 0; significance < 8; ++significance) {
    unsigned char* const same = bytes.data() + significance * count;
    for (std::size_t k = 0; k < count; ++k) {
      same[k] = static_cast<unsigned char>(std::bit_cast<std::uint64_t>(numbers[k]) >> (8 * significance));
    }
  }
}

/// As zlib would; false where that is no shorter.
bool deflate(std::vector<unsigned char>& bytes, std::vector<unsigned char>& packed) {
  thread_local std::vector<unsigned char> memory(ISAL_DEF_LVL1_DEFAULT);
  packed.resize(bytes.size());
  isal_zstream stream;
  isal_deflate_stateless_init(&stream);
  stream.level = 1;
  stream.level_buf = memory.data();
  stream.level_buf_size = static_cast<std::uint32_t>(memory.size());
  stream.gzip_flag = IGZIP_ZLIB;
  stream.end_of_stream = 1;
  stream.next_in = bytes.data();
  stream.avail_in = static_cast<std::uint32_t>(bytes.size());
  stream.next_out = packed.data();
  stream.avail_out = static_cast<std::uint32_t>(packed.size());
  if (isal_deflate_stateless(&stream) != COMP_OK) return false;
  packed.resize(stream.total_out);
  return true;
}

/// Bob Jenkins' lookup3, with which the format checks its superblock.
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

/// A file of the system, closed when it goes.
struct Descriptor {
  int number;
  ~Descriptor() {
    if (number >= 0) close(number);
  }
};

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

// What is written next leads to places beyond the end that the superblock tells, until that is written itself, last:
// the file says before how long it will be.
void make_room(const Handle& file, const std::string& name) {
  hsize_t wanted = 0;
  struct stat status {};
  const Descriptor descriptor{open(name.c_str(), O_RDWR | O_CLOEXEC)};
  if (descriptor.number < 0 || fstat(descriptor.number, &status) != 0) return;
  if (H5Fget_filesize(file.get(), &wanted) < 0 || static_cast<hsize_t>(status.st_size) > wanted) return;
  if (ftruncate(descriptor.number, static_cast<off_t>(wanted)) == 0) mark_as_closed(name);
}

}  // namespace

Error::Error() : std::runtime_error(reason()) {}

void begin() {
  H5dont_atexit();  // it would try again, and complain, where a full disk has kept a file from being closed
  require(H5open());
  require(H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr));
}

Handle create_file(const std::string& file) {
  const Handle properties = property_list(H5P_FILE_CREATE);
  require(H5Pset_link_creation_order(properties.get(), H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED));
  errno = 0;
  return {H5Fcreate(file.c_str(), H5F_ACC_TRUNC, properties.get(), file_access().get()), H5Fclose};
}

Handle open_file(const std::string& file, bool writable) {
  errno = 0;
  const unsigned mode = writable ? H5F_ACC_RDWR : H5F_ACC_RDONLY | H5F_ACC_SWMR_READ;
  return {H5Fopen(file.c_str(), mode, file_access().get()), H5Fclose};
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

// The superblock of version 3: signature (8), version (1), sizes (2), flags (1), four addresses (32), of which the
// third is the end of the file, checksum (4).
void mark_as_closed(const std::string& file) {
  constexpr std::size_t version_at = 8, flags_at = 11, end_at = 28, checksum_at = 44;
  std::array<unsigned char, 48> block{};
  struct stat status {};
  const Descriptor descriptor{open(file.c_str(), O_RDWR | O_CLOEXEC)};
  if (descriptor.number < 0 || pread(descriptor.number, block.data(), block.size(), 0) != ssize_t{48}) return;
  if (block[version_at] != 3 || fstat(descriptor.number, &status) != 0) return;
  const std::array<unsigned char, 48> before = block;
  block[flags_at] = 0;
  const auto end = static_cast<std::uint64_t>(status.st_size);
  if (number_in(std::span(block).subspan(end_at, 8)) < end) put_number(end, std::span(block).subspan(end_at, 8));
  if (block == before) return;
  put_number(checksum(std::span(block).first(checksum_at)), std::span(block).subspan(checksum_at, 4));
  if (pwrite(descriptor.number, block.data(), block.size(), 0) != ssize_t{48}) return;  // then it stays as it was
}

Handle create_group(const Handle& where, const std::string& name) {
  return {H5Gcreate2(where.get(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose};
}

Handle open_group(const Handle& where, const std::string& name) {
  return {H5Gopen2(where.get(), name.c_str(), H5P_DEFAULT), H5Gclose};
}

bool has(const Handle& where, const std::string& name) {
  return H5Lexists(where.get(), name.c_str(), H5P_DEFAULT) > 0;
}

void write_attribute(const Handle& object, const std::string& name, const std::string& text) {
  const Handle type = text_type();
  const char* const begin = text.c_str();
  const Handle attribute = create_attribute(object, name, type.get(), Handle(H5Screate(H5S_SCALAR), H5Sclose));
  require(H5Awrite(attribute.get(), type.get(), &begin));
}

void write_attribute(const Handle& object, const std::string& name, std::int64_t number) {
  const Handle attribute = create_attribute(object, name, H5T_STD_I64LE, Handle(H5Screate(H5S_SCALAR), H5Sclose));
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
  const Handle type = text_type(), space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle dataset(
      H5Dcreate2(where.get(), name.c_str(), type.get(), space.get(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Dclose);
  const char* const begin = text.c_str();
  require(H5Dwrite(dataset.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, &begin));
}

std::string read_text(const Handle& where, const std::string& name) {
  const Handle dataset = open_dataset(where, name);
  char* text = nullptr;
  require(H5Dread(dataset.get(), text_type().get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, &text));
  return taken(text);
}

Handle create_numbering(const Handle& where, const std::string& name, std::size_t count) {
  const std::array<hsize_t, 1> extent{count};
  const Handle space = space_of(extent);
  Handle dataset(
      H5Dcreate2(where.get(), name.c_str(), H5T_STD_I32LE, space.get(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
      H5Dclose);
  std::vector<int> numbers(count);
  std::iota(numbers.begin(), numbers.end(), 1);
  require(H5Dwrite(dataset.get(), H5T_NATIVE_INT, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()));
  return dataset;
}

Handle create_number(const Handle& where, const std::string& name, double number) {
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  Handle dataset(
      H5Dcreate2(where.get(), name.c_str(), H5T_IEEE_F64LE, space.get(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
      H5Dclose);
  require(H5Dwrite(dataset.get(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, &number));
  return dataset;
}

Handle create_vector(const Handle& where, const std::string& name, std::span<const double> numbers) {
  const std::array<hsize_t, 1> extent{numbers.size()};
  const Handle space = space_of(extent);
  Handle dataset(
      H5Dcreate2(where.get(), name.c_str(), H5T_IEEE_F64LE, space.get(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
      H5Dclose);
  require(H5Dwrite(dataset.get(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()));
  return dataset;
}

Handle create_texts(const Handle& where, const std::string& name, std::span<const std::string> texts) {
  const std::array<hsize_t, 1> extent{texts.size()};
  const Handle space = space_of(extent), type = text_type();
  Handle dataset(H5Dcreate2(where.get(), name.c_str(), type.get(), space.get(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                 H5Dclose);
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
  return {
      H5Dcreate2(where.get(), name.c_str(), stored_as(type), space.get(), H5P_DEFAULT, properties.get(), H5P_DEFAULT),
      H5Dclose};
}

std::uint64_t offset_of(const Handle& array) {
  const haddr_t offset = H5Dget_offset(array.get());
  if (offset == HADDR_UNDEF) throw Error();
  return offset;
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

Handle create_rows(const Handle& where, const std::string& name, std::size_t size, std::size_t chunk_rows) {
  const Handle space = growing_space(size), properties = growing_properties(size, chunk_rows);
  require(H5Pset_shuffle(properties.get()));
  require(H5Pset_deflate(properties.get(), 1));
  set_fill(properties, Type::real);
  return {
      H5Dcreate2(where.get(), name.c_str(), H5T_IEEE_F64LE, space.get(), H5P_DEFAULT, properties.get(), H5P_DEFAULT),
      H5Dclose};
}

Handle create_list(const Handle& where, const std::string& name, std::size_t size, std::size_t chunk_rows, Type type) {
  const Handle space = growing_space(size), properties = growing_properties(size, chunk_rows);
  set_fill(properties, type);
  return {
      H5Dcreate2(where.get(), name.c_str(), stored_as(type), space.get(), H5P_DEFAULT, properties.get(), H5P_DEFAULT),
      H5Dclose};
}

Handle create_table(const Handle& where, const std::string& name, std::size_t rows, std::size_t columns) {
  const std::array<hsize_t, 2> extent{rows, columns};
  const Handle space = space_of(extent);
  const Handle properties = property_list(H5P_DATASET_CREATE);
  require(H5Pset_alloc_time(properties.get(), H5D_ALLOC_TIME_EARLY));
  return {
      H5Dcreate2(where.get(), name.c_str(), H5T_IEEE_F64LE, space.get(), H5P_DEFAULT, properties.get(), H5P_DEFAULT),
      H5Dclose};
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

std::vector<std::size_t> extent(const Handle& dataset) {
  const Handle space(H5Dget_space(dataset.get()), H5Sclose);
  std::vector<hsize_t> extent(static_cast<std::size_t>(require(H5Sget_simple_extent_ndims(space.get()))));
  require(H5Sget_simple_extent_dims(space.get(), extent.data(), nullptr));
  return {extent.begin(), extent.end()};
}

void set_rows(const Handle& dataset, std::size_t rows) {
  const std::vector<std::size_t> now = extent(dataset);
  std::vector<hsize_t> wanted(now.begin(), now.end());
  wanted[0] = rows;
  errno = 0;
  require(H5Dset_extent(dataset.get(), wanted.data()));
}

// Filters are told by a mask of those that were left out: one that is not packed has none.
void write_chunk(const Handle& dataset, std::size_t row, std::span<const double> numbers, bool packed) {
  constexpr std::uint32_t no_filter = 0b11, not_deflated = 0b10;
  thread_local std::vector<unsigned char> shuffled, deflated;
  const std::array<hsize_t, 2> offset{row, 0};
  const auto write = [&](std::uint32_t left_out, const void* bytes, std::size_t size) {
    errno = 0;
    require(H5Dwrite_chunk(dataset.get(), H5P_DEFAULT, left_out, offset.data(), size, bytes));
  };
  if (!packed) return write(no_filter, numbers.data(), numbers.size_bytes());
  shuffle(numbers, shuffled);
  if (deflate(shuffled, deflated)) return write(0, deflated.data(), deflated.size());
  write(not_deflated, shuffled.data(), shuffled.size());
}

std::vector<double> read_rows(const Handle& dataset, std::size_t first, std::size_t rows) {
  const std::vector<std::size_t> all = extent(dataset);
  std::vector<hsize_t> count(all.begin(), all.end()), offset(count.size(), 0);
  count[0] = rows;
  offset[0] = first;
  const Handle wanted(H5Dget_space(dataset.get()), H5Sclose);
  require(H5Sselect_hyperslab(wanted.get(), H5S_SELECT_SET, offset.data(), nullptr, count.data(), nullptr));
  const Handle memory = space_of(count);
  std::vector<double> numbers(
      std::accumulate(count.begin(), count.end(), std::size_t{1}, [](std::size_t a, hsize_t b) { return a * b; }));
  require(H5Dread(dataset.get(), H5T_NATIVE_DOUBLE, memory.get(), wanted.get(), H5P_DEFAULT, numbers.data()));
  return numbers;
}

void write_rows(const Handle& table, std::size_t first, std::span<const double> numbers) {
  const std::vector<std::size_t> all = extent(table);
  std::vector<hsize_t> count(all.begin(), all.end()), offset(count.size(), 0);
  count[0] = numbers.size() / (all.size() == 1 ? 1 : all[1]);
  offset[0] = first;
  const Handle wanted(H5Dget_space(table.get()), H5Sclose);
  require(H5Sselect_hyperslab(wanted.get(), H5S_SELECT_SET, offset.data(), nullptr, count.data(), nullptr));
  const Handle memory = space_of(count);
  errno = 0;
  require(H5Dwrite(table.get(), H5T_NATIVE_DOUBLE, memory.get(), wanted.get(), H5P_DEFAULT, numbers.data()));
}

// A text of its own length would lie in a heap, which cannot grow while others read the file. Mostly zeros, it packs
// well.
Handle create_late_text(const Handle& where, const std::string& name, std::size_t room) {
  const Handle type = padded_text_type(room), space = growing_space(0), properties = growing_properties(0, 1);
  require(H5Pset_deflate(properties.get(), 1));
  return {H5Dcreate2(where.get(), name.c_str(), type.get(), space.get(), H5P_DEFAULT, properties.get(), H5P_DEFAULT),
          H5Dclose};
}

void write_late_text(const Handle& dataset, const std::string& text) {
  const Handle type(H5Dget_type(dataset.get()), H5Tclose);
  std::string padded = text;
  if (padded.size() > H5Tget_size(type.get())) return;
  padded.resize(H5Tget_size(type.get()));
  set_rows(dataset, 1);
  errno = 0;
  require(H5Dwrite(dataset.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, padded.data()));
}

}  // namespace pendula::io::hdf5
