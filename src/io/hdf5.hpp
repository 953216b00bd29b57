#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

/// HDF5 files with errors as exceptions, identifiers that close themselves, and no output on standard error.
namespace pendula::io::hdf5 {

/// A call to HDF5 failed; the message is that of the deepest failing call.
class Error : public std::runtime_error {
 public:
  Error();
};

/// Throws Error on a negative status or identifier.
template <class Status>
Status require(Status status) {
  if (status < 0) throw Error();
  return status;
}

/// An HDF5 identifier, closed by the destructor.
class Handle {
 public:
  using Id = std::int64_t;
  using Close = int (*)(Id);

  Handle() = default;
  Handle(Id id, Close closer) : id_(require(id)), close_(closer) {}
  ~Handle() { close(); }
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Handle& operator=(Handle&& other) noexcept {
    close();
    id_ = std::exchange(other.id_, -1);
    close_ = other.close_;
    return *this;
  }

  Id get() const { return id_; }
  /// Gives the identifier up without closing it: closing would write, which has failed.
  void abandon() { id_ = -1; }
  /// Closes the identifier; false if that failed.
  bool close() { return id_ < 0 || close_(std::exchange(id_, -1)) >= 0; }

 private:
  Id id_ = -1;
  Close close_ = nullptr;
};

/// Silences the error output of HDF5, and leaves closing files to this program. To be called before anything else.
void begin();

Handle create_file(const std::string& file);
/// Opens a file for reading, even while another process writes it.
Handle open_file(const std::string& file);

/// From now on other processes may read the file while it is written; no objects can be added any more.
void let_others_read(const Handle& file);

/// Writes what HDF5 has buffered, and marks the file as closed: without the mark, HDF5 refuses the file of a killed
/// program as incomplete. It is complete, because this way of writing (SWMR) writes a part only after what it points
/// to.
void flush(const Handle& file, const std::string& name);

/// Marks the file of a killed program as closed, and sets its recorded end to its size.
void mark_as_closed(const std::string& file);

Handle create_group(const Handle& where, const std::string& name);
Handle open_group(const Handle& where, const std::string& name);
bool has(const Handle& where, const std::string& name);

/// Replaces an attribute of the same name.
void write_attribute(const Handle& object, const std::string& name, const std::string& text);
void write_attribute(const Handle& object, const std::string& name, std::int64_t number);
bool has_attribute(const Handle& object, const std::string& name);
std::string read_attribute(const Handle& object, const std::string& name);
std::int64_t read_number(const Handle& object, const std::string& name);

void write_text(const Handle& where, const std::string& name, const std::string& text);
std::string read_text(const Handle& where, const std::string& name);

/// Makes a vector of the numbers 1, 2, … of the links.
Handle create_numbering(const Handle& where, const std::string& name, std::size_t count);

/// One number.
Handle create_number(const Handle& where, const std::string& name, double number);

/// A vector of numbers, or of texts.
Handle create_vector(const Handle& where, const std::string& name, std::span<const double> numbers);
Handle create_texts(const Handle& where, const std::string& name, std::span<const std::string> texts);

/// What an array holds: doubles, integers of 64 bits or of 8.
enum class Type { real, whole, byte };
/// An array that is contiguous in its file, filled with NaN or −1. offset_of is the byte of the file at which it
/// begins.
Handle create_array(const Handle& where, const std::string& name, std::span<const std::int64_t> extent, Type type);
std::uint64_t offset_of(const Handle& array);

/// Says what the values first, first + 1, … of an array mean, by the CF attributes `flag_values` and `flag_meanings`
/// (one word each).
void write_flags(const Handle& array, Type type, int first, std::span<const std::string> meanings);

/// A table of rows of `size` numbers each (a vector where `size` is 0) that grows by chunks of `chunk_rows`.
Handle create_rows(const Handle& where, const std::string& name, std::size_t size, std::size_t chunk_rows);
/// The same for any type; rows are written in place and not compressed.
Handle create_list(const Handle& where, const std::string& name, std::size_t size, std::size_t chunk_rows, Type type);
/// A table of fixed size that can be written in place.
Handle create_table(const Handle& where, const std::string& name, std::size_t rows, std::size_t columns);
/// Makes a vector a dimension scale, as in netCDF.
void make_scale(const Handle& dataset, const std::string& name);
void attach_scale(const Handle& dataset, const Handle& scale, unsigned axis);

Handle open_dataset(const Handle& where, const std::string& name);

std::vector<std::size_t> extent(const Handle& dataset);
void set_rows(const Handle& dataset, std::size_t rows);

/// Writes the chunk that begins with `row`, compressed as by the filters of the data set if `packed`.
void write_chunk(const Handle& dataset, std::size_t row, std::span<const double> numbers, bool packed);
std::vector<double> read_rows(const Handle& dataset, std::size_t first, std::size_t rows);
/// Writes whole rows from the row `first` on.
void write_rows(const Handle& table, std::size_t first, std::span<const double> numbers);

/// Reserves `room` bytes for a text that can be written while others read the file.
Handle create_late_text(const Handle& where, const std::string& name, std::size_t room);
/// Writes that text; writes nothing if it is too long.
void write_late_text(const Handle& dataset, const std::string& text);
/// Reads that text; empty if none was written.
std::string read_late_text(const Handle& where, const std::string& name);

}  // namespace pendula::io::hdf5
