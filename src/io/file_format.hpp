#pragma once

#include <string>

namespace pendula::io {

/// Formats of files of numbers.
enum class FileFormat { csv, hdf5 };

/// The format by the ending of the name: CSV for .csv, for "-", and for anything that is no regular file, as
/// /dev/stdout; HDF5 for .h5, .hdf5 and .nc. Throws InputError with the list on any other name.
FileFormat format_of(const std::string& file);

/// Throws InputError unless a file has the only format in which `what` can be written.
void require_format(const std::string& file, FileFormat format, const std::string& what);

}  // namespace pendula::io
