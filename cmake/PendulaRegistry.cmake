# PENDULA_KERNELS: the fixed-n kernels of this build. Each gets its header and one translation unit of its own, so that
# they compile side by side and none is compiled again for another's sake; a generated table makes them known at run time.
include_guard(GLOBAL)

set(PENDULA_INCLUDE_DIR "${PROJECT_BINARY_DIR}/include")
set(PENDULA_CODEGEN_DIR "${PROJECT_SOURCE_DIR}/codegen" CACHE PATH "Folder of the Python package pendula_codegen")
mark_as_advanced(PENDULA_CODEGEN_DIR)
set(PENDULA_GENERATED_DIR "${PROJECT_SOURCE_DIR}/generated")
pendula_kernel_locations(GENERATED "${PENDULA_GENERATED_DIR}" CODEGEN "${PENDULA_CODEGEN_DIR}")

# The kernels that generated/ holds, as <space>:<links>.
function(_pendula_committed_kernels out_kernels)
  file(GLOB headers RELATIVE "${PENDULA_GENERATED_DIR}" "${PENDULA_GENERATED_DIR}/*.hpp")
  list(FILTER headers INCLUDE REGEX "^(planar|spatial)_[0-9]+\\.hpp$")
  list(TRANSFORM headers REPLACE "^([a-z]+)_([0-9]+)\\.hpp$" "\\1:\\2")
  list(SORT headers COMPARE NATURAL)
  set(${out_kernels} "${headers}" PARENT_SCOPE)
endfunction()

_pendula_committed_kernels(_pendula_default_kernels)
set(PENDULA_KERNELS "${_pendula_default_kernels}" CACHE STRING "Fixed-n kernels to build in: <space>:<links>;...")

# Sets OUT_PAIRS to PENDULA_KERNELS, checked, sorted, each once.
function(_pendula_checked_kernels out_kernels)
  foreach(kernel IN LISTS PENDULA_KERNELS)
    set(problem "expected <space>:<links>, such as spatial:3")
    if(kernel MATCHES "^([^:]*):([^:]*)$")
      pendula_check_kernel("${CMAKE_MATCH_1}" "${CMAKE_MATCH_2}" problem)
    endif()
    if(problem)
      message(FATAL_ERROR "PENDULA_KERNELS: \"${kernel}\": ${problem}")
    endif()
  endforeach()
  list(REMOVE_DUPLICATES PENDULA_KERNELS)
  list(SORT PENDULA_KERNELS COMPARE NATURAL)
  set(${out_kernels} "${PENDULA_KERNELS}" PARENT_SCOPE)
endfunction()

# Headers of the kernels selected, and those that every build has: link kernels and Gauss tableaux.
# Sets OUT_HEADERS to their paths in the build, and makes the target pendula_kernel_headers.
function(pendula_selected_headers out_headers)
  set(headers "")
  set(makers "")
  foreach(kernel IN LISTS PENDULA_KERNELS)
    string(REPLACE ":" ";" parts "${kernel}")
    list(GET parts 0 space)
    list(GET parts 1 links)
    pendula_kernel_header(${space} ${links} "${PENDULA_INCLUDE_DIR}" include maker)
    list(APPEND headers "${PENDULA_INCLUDE_DIR}/pendula/kernels/${space}_${links}.hpp")
    list(APPEND makers ${maker})
  endforeach()
  set(common "")
  foreach(name IN ITEMS planar_link spatial_link gauss_tableaux)
    set(header "${PENDULA_INCLUDE_DIR}/pendula/kernels/${name}.hpp")
    pendula_copy_generated("${PENDULA_GENERATED_DIR}/${name}.hpp" "${header}")
    list(APPEND common "${header}")
  endforeach()
  add_custom_target(pendula_kernel_headers DEPENDS ${common})
  if(makers)
    add_dependencies(pendula_kernel_headers ${makers})
  endif()
  set(${out_headers} ${headers} ${common} PARENT_SCOPE)
endfunction()

# Translation units of the kernels selected, and the table of them. Sets OUT_SOURCES.
function(pendula_registry_sources out_sources)
  set(folder "${PROJECT_BINARY_DIR}/kernels")
  set(sources "")
  set(declarations "")
  foreach(space IN ITEMS planar spatial)
    set(${space}_entries "")
    set(${space}_count 0)
  endforeach()
  foreach(kernel IN LISTS PENDULA_KERNELS)
    string(REPLACE ":" ";" parts "${kernel}")
    list(GET parts 0 space)
    list(GET parts 1 links)
    set(name "${space}_${links}")
    set(Space Planar)
    if(space STREQUAL "spatial")
      set(Space Spatial)
    endif()
    configure_file("${PROJECT_SOURCE_DIR}/cmake/dense_kernel.cpp.in" "${folder}/dense_${name}.cpp" @ONLY)
    list(APPEND sources "${folder}/dense_${name}.cpp")
    string(APPEND declarations "Make make_${name};\nCheck check_${name};\n")
    string(APPEND ${space}_entries "    {{\"${name}\", \"${space}\", ${links}}, make_${name}, check_${name}},\n")
    math(EXPR ${space}_count "${${space}_count} + 1")
  endforeach()
  configure_file("${PROJECT_SOURCE_DIR}/cmake/kernel_table.hpp.in" "${folder}/kernel_table.hpp" @ONLY)
  configure_file("${PROJECT_SOURCE_DIR}/cmake/library.cpp.in" "${folder}/library.cpp" @ONLY)
  set(${out_sources} ${sources} "${folder}/library.cpp" PARENT_SCOPE)
endfunction()

# What to run to write generated/ afresh; a build never does it by itself.
function(pendula_add_refresh_target)
  pendula_find_python("${PENDULA_CODEGEN_DIR}/requirements.txt" python problem)
  if(problem)
    add_custom_target(refresh-generated COMMAND "${CMAKE_COMMAND}" -E echo "refresh-generated: ${problem}"
                                        COMMAND "${CMAKE_COMMAND}" -E false VERBATIM)
  else()
    add_custom_target(
      refresh-generated
      COMMAND "${CMAKE_COMMAND}" -E env "PYTHONPATH=${PENDULA_CODEGEN_DIR}" PYTHONDONTWRITEBYTECODE=1 "${python}"
              -m pendula_codegen refresh --output "${PENDULA_GENERATED_DIR}"
      COMMENT "Writing generated/ afresh" VERBATIM USES_TERMINAL)
  endif()
endfunction()

_pendula_checked_kernels(PENDULA_KERNELS)
