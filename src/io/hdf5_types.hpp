#pragma once

#include <hdf5.h>

#include <span>
#include <string>

#include "io/hdf5.hpp"

/// Types, data spaces and property lists of HDF5.
namespace pendula::io::hdf5 {

Handle property_list(hid_t of);
Handle text_type();
Handle space_of(std::span<const hsize_t> extent, const hsize_t* most = nullptr);
/// The data space of one value.
Handle single_space();

/// The type of numbers in the file.
hid_t stored_as(Type type);
/// Sets the fill value of an array of that type: NaN or −1.
void set_fill(const Handle& properties, Type type);

/// Copies a text that HDF5 has allocated, and frees it.
std::string taken(char* text);

/// A data set; `properties` may be none.
Handle create_dataset(const Handle& where, const std::string& name, hid_t type, const Handle& space,
                      const Handle& properties = {});

}  // namespace pendula::io::hdf5
