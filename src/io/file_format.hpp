#pragma once

#include <string>

namespace pendula::io {

/// What a file of numbers is, by the ending of its name.
enum class FileFormat { csv, hdf5 };

/// CSV of names that end in .csv, of "-", and of what is there and is no regular file, as /dev/stdout; HDF5 of .h5,
/// .hdf5 and .nc. Throws InputError on any other name, with the list.
FileFormat format_of(const std::string& file);

/// Throws InputError where a file is not of the only format that `what` is written in.
void require_format(const std::string& file, FileFormat format, const std::string& what);

}  // namespace pendula::io
