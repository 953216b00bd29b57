# The headers of xsimd, as pendula::xsimd. Debian's own xsimdConfig.cmake makes a target that links a library which is not
# there (xtl), so the headers are found by name.
find_path(XSIMD_INCLUDE_DIR xsimd/xsimd.hpp DOC "Folder that holds xsimd/xsimd.hpp (Debian: libxsimd-dev)")
mark_as_advanced(XSIMD_INCLUDE_DIR)
if(XSIMD_INCLUDE_DIR AND NOT TARGET pendula::xsimd)
  add_library(pendula::xsimd INTERFACE IMPORTED)
  set_target_properties(pendula::xsimd PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${XSIMD_INCLUDE_DIR}")
endif()
