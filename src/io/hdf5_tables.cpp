// Makes, compresses, writes and reads tables that grow: run_file.cpp says what stands in them.

#include <hdf5.h>
#include <isa-l/igzip_lib.h>

#include <array>
#include <bit>
#include <cerrno>
#include <cstdint>
#include <functional>
#include <numeric>

#include "io/hdf5.hpp"
#include "io/hdf5_types.hpp"

namespace pendula::io::hdf5 {
namespace {

/// An unlimited number of rows of `size` numbers; a vector if `size` is 0.
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

/// Texts of a fixed length, padded with zeros.
Handle padded_text_type(std::size_t room) {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  require(H5Tset_size(type.get(), room));
  require(H5Tset_strpad(type.get(), H5T_STR_NULLPAD));
  require(H5Tset_cset(type.get(), H5T_CSET_UTF8));
  return type;
}

/// Groups bytes by significance, as the shuffle filter does: similar bytes compress better.
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

/// Compresses as zlib; false if the result is not shorter.
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

}  // namespace

Handle create_rows(const Handle& where, const std::string& name, std::size_t size, std::size_t chunk_rows) {
  const Handle space = growing_space(size), properties = growing_properties(size, chunk_rows);
  require(H5Pset_shuffle(properties.get()));
  require(H5Pset_deflate(properties.get(), 1));
  set_fill(properties, Type::real);
  return create_dataset(where, name, H5T_IEEE_F64LE, space, properties);
}

Handle create_list(const Handle& where, const std::string& name, std::size_t size, std::size_t chunk_rows, Type type) {
  const Handle space = growing_space(size), properties = growing_properties(size, chunk_rows);
  set_fill(properties, type);
  return create_dataset(where, name, stored_as(type), space, properties);
}

Handle create_table(const Handle& where, const std::string& name, std::size_t rows, std::size_t columns) {
  const std::array<hsize_t, 2> extent{rows, columns};
  const Handle space = space_of(extent);
  const Handle properties = property_list(H5P_DATASET_CREATE);
  require(H5Pset_alloc_time(properties.get(), H5D_ALLOC_TIME_EARLY));
  return create_dataset(where, name, H5T_IEEE_F64LE, space, properties);
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

// A chunk has a mask of the filters that were not applied: of all of them if it is not packed.
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

// A text of variable length would lie in a heap, which cannot grow while others read the file. The padding compresses
// well.
Handle create_late_text(const Handle& where, const std::string& name, std::size_t room) {
  const Handle type = padded_text_type(room), space = growing_space(0), properties = growing_properties(0, 1);
  require(H5Pset_deflate(properties.get(), 1));
  return create_dataset(where, name, type.get(), space, properties);
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

std::string read_late_text(const Handle& where, const std::string& name) {
  const Handle dataset = open_dataset(where, name);
  if (extent(dataset)[0] == 0) return {};
  const Handle type(H5Dget_type(dataset.get()), H5Tclose);
  std::string text(H5Tget_size(type.get()), '\0');
  require(H5Dread(dataset.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, text.data()));
  return text.substr(0, text.find('\0'));
}

}  // namespace pendula::io::hdf5
