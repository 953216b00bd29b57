# What run files are written with, as pendula::run_files: HDF5 and ISA-L, whose deflate is five times as fast as zlib's.
# CMake's own FindHDF5 asks for a C compiler; Debian's ISA-L has no file for CMake. Of the HDF5 that Debian has, the one
# without MPI.
include_guard(GLOBAL)
find_path(HDF5_INCLUDE_DIR hdf5.h PATH_SUFFIXES hdf5/serial DOC "Folder that holds hdf5.h (Debian: libhdf5-dev)")
find_library(HDF5_LIBRARY NAMES hdf5_serial hdf5 DOC "HDF5, the library (Debian: libhdf5-dev)")
find_library(HDF5_HL_LIBRARY NAMES hdf5_serial_hl hdf5_hl DOC "HDF5, its high-level library (Debian: libhdf5-dev)")
find_path(ISAL_INCLUDE_DIR isa-l/igzip_lib.h DOC "Folder that holds isa-l/igzip_lib.h (Debian: libisal-dev)")
find_library(ISAL_LIBRARY isal DOC "ISA-L, the library (Debian: libisal-dev)")

set(parts HDF5_INCLUDE_DIR HDF5_LIBRARY HDF5_HL_LIBRARY ISAL_INCLUDE_DIR ISAL_LIBRARY)
mark_as_advanced(${parts})
foreach(part IN LISTS parts)
  if(NOT ${part})
    message(FATAL_ERROR "pendula: ${part} was not found; install libhdf5-dev and libisal-dev (scripts/setup does), or "
                        "set ${part}")
  endif()
endforeach()
add_library(pendula::run_files INTERFACE IMPORTED)
target_include_directories(pendula::run_files INTERFACE "${HDF5_INCLUDE_DIR}" "${ISAL_INCLUDE_DIR}")
target_link_libraries(pendula::run_files INTERFACE "${HDF5_HL_LIBRARY}" "${HDF5_LIBRARY}" "${ISAL_LIBRARY}")
