// Attributes, and data sets of text.

#include <hdf5.h>

#include <array>
#include <numeric>

#include "io/hdf5.hpp"
#include "io/hdf5_types.hpp"

namespace pendula::io::hdf5 {
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
