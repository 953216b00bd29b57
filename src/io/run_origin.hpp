#pragma once

#include <string>
#include <vector>

#include "io/hdf5.hpp"

namespace pendula::io {

/// Where the numbers of a run file come from: program, command, scenario, model.
struct RunOrigin {
  std::string version;                 ///< of pendula
  std::string instruction_set;         ///< of the library that ran it
  std::string solver, kernel;          ///< as in a summary; may be empty
  std::string title;                   ///< one line
  std::string command;                 ///< the present command
  std::string history;                 ///< earlier commands, a line each
  std::string scenario_name;           ///< public name of its file
  std::string scenario;                ///< its text
  std::vector<std::string> overrides;  ///< `key.path=value`
  std::string model;                   ///< text of the model's file; empty where there is none
};

/// Writes it into a new file. Returns the group `run`.
hdf5::Handle write_origin(const hdf5::Handle& file, const RunOrigin& origin);

/// Reads it from a file and its group `run`. Throws ChangedFile, hdf5::Error, nlohmann::json::exception.
RunOrigin read_origin(const hdf5::Handle& file, const hdf5::Handle& run);

/// Throws ChangedFile unless it matches its checksum.
void require_written(const RunOrigin& origin, const hdf5::Handle& run);

}  // namespace pendula::io
