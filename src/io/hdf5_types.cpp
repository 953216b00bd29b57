#include "io/hdf5_types.hpp"

#include <cmath>
#include <cstdint>

namespace pendula::io::hdf5 {

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

}  // namespace pendula::io::hdf5
