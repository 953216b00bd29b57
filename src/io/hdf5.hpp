#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

/// HDF5 files with errors as exceptions, identifiers that close themselves, and no word on standard error.
namespace pendula::io::hdf5 {

/// What the library says of a call that failed; its deepest reason.
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

/// An identifier of the library, closed when it goes.
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
  /// Leaves it open for good: closing would write, and cannot.
  void abandon() { id_ = -1; }
  /// Whether closing it went well.
  bool close() { return id_ < 0 || close_(std::exchange(id_, -1)) >= 0; }

 private:
  Id id_ = -1;
  Close close_ = nullptr;
};

/// Keeps the library silent, and lets this program close its files itself. To be called before anything else.
void begin();

Handle create_file(const std::string& file);
/// To be written, or to be read, also while it is written.
Handle open_file(const std::string& file, bool writable);

/// From here on others may read the file while it is written; objects can no longer be added to it.
void let_others_read(const Handle& file);

/// Writes what the library holds back, and marks the file as one that is not open: otherwise what a killed program
/// leaves could be opened only by those who know that it may be incomplete. It is not: in this way of writing, whatever
/// is in the file leads only to what was there before.
void flush(const Handle& file, const std::string& name);

/// Takes that mark off a file that some program was killed with, which ends where it ends.
void mark_as_closed(const std::string& file);

Handle create_group(const Handle& where, const std::string& name);
Handle open_group(const Handle& where, const std::string& name);
bool has(const Handle& where, const std::string& name);

/// In place of one that is there.
void write_attribute(const Handle& object, const std::string& name, const std::string& text);
void write_attribute(const Handle& object, const std::string& name, std::int64_t number);
bool has_attribute(const Handle& object, const std::string& name);
std::string read_attribute(const Handle& object, const std::string& name);
std::int64_t read_number(const Handle& object, const std::string& name);

void write_text(const Handle& where, const std::string& name, const std::string& text);
std::string read_text(const Handle& where, const std::string& name);

/// Whole numbers 1, 2, … that count the links.
Handle create_numbering(const Handle& where, const std::string& name, std::size_t count);

/// One number.
Handle create_number(const Handle& where, const std::string& name, double number);

/// A vector of numbers, or of texts.
Handle create_vector(const Handle& where, const std::string& name, std::span<const double> numbers);
Handle create_texts(const Handle& where, const std::string& name, std::span<const std::string> texts);

/// What an array holds: doubles, integers of 64 bits or of 8.
enum class Type { real, whole, byte };
/// An array that lies in one piece in its file, filled with NaN, or −1; and the byte of the file that it begins at.
Handle create_array(const Handle& where, const std::string& name, std::span<const std::int64_t> extent, Type type);
std::uint64_t offset_of(const Handle& array);

/// What the values first, first + 1, … of an array mean, as CF has it: `flag_values`, of its own type, and
/// `flag_meanings`, a word each.
void write_flags(const Handle& array, Type type, int first, std::span<const std::string> meanings);

/// A table of rows of `size` numbers each (a vector where `size` is 0) that grows by chunks of `chunk_rows`.
Handle create_rows(const Handle& where, const std::string& name, std::size_t size, std::size_t chunk_rows);
/// The same of any type, whose rows are written in place, and not packed.
Handle create_list(const Handle& where, const std::string& name, std::size_t size, std::size_t chunk_rows, Type type);
/// One that neither grows nor moves: it can be written in place.
Handle create_table(const Handle& where, const std::string& name, std::size_t rows, std::size_t columns);
/// Makes a vector the scale of an axis of others, as netCDF has it.
void make_scale(const Handle& dataset, const std::string& name);
void attach_scale(const Handle& dataset, const Handle& scale, unsigned axis);

Handle open_dataset(const Handle& where, const std::string& name);

std::vector<std::size_t> extent(const Handle& dataset);
void set_rows(const Handle& dataset, std::size_t rows);

/// Writes the chunk that begins with `row`; a whole one as the dataset's filters would, if it is `packed`.
void write_chunk(const Handle& dataset, std::size_t row, std::span<const double> numbers, bool packed);
std::vector<double> read_rows(const Handle& dataset, std::size_t first, std::size_t rows);
/// Writes whole rows from the row `first` on.
void write_rows(const Handle& table, std::size_t first, std::span<const double> numbers);

/// A text of up to `room` bytes that can be written while others read the file; none yet.
Handle create_late_text(const Handle& where, const std::string& name, std::size_t room);
/// Writes it, or leaves it as it is where there is no room.
void write_late_text(const Handle& dataset, const std::string& text);

}  // namespace pendula::io::hdf5
