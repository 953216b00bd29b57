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
set(PENDULA_KERNELS "${_pendula_default_kernels}" CACHE STRING
    "Kernels to build in: <space>:<links>;<model>[:<links>];...")

# Sets OUT_KERNELS to PENDULA_KERNELS, checked, sorted, each once; blanks and empty elements do not count.
function(_pendula_checked_kernels out_kernels)
  list(TRANSFORM PENDULA_KERNELS STRIP)
  list(FILTER PENDULA_KERNELS EXCLUDE REGEX "^$")
  foreach(kernel IN LISTS PENDULA_KERNELS)
    set(problem "expected <space>:<links>, such as spatial:3, or a model, such as atwood.py or cart.py:2")
    string(REGEX REPLACE ":[^:]*$" "" model "${kernel}")
    if(model MATCHES "\\.py$" OR EXISTS "${PENDULA_CODEGEN_DIR}/pendula_codegen/models/${model}.py")
      set(links "")
      if(kernel MATCHES ":([^:]*)$")
        set(links "${CMAKE_MATCH_1}")
      endif()
      pendula_check_model("${model}" "${links}" problem)
    elseif(kernel MATCHES "^([^:]*):([^:]*)$")
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
    if(kernel MATCHES "^(.*\\.py)(.*)$")
      set(links "${CMAKE_MATCH_2}")
      get_filename_component(kernel "${CMAKE_MATCH_1}" ABSOLUTE BASE_DIR "${PROJECT_SOURCE_DIR}")
      string(APPEND kernel "${links}")
    endif()
    pendula_kernel_header("${kernel}" "${PENDULA_INCLUDE_DIR}" include maker)
    pendula_kernel_name("${kernel}" name struct)
    list(APPEND headers "${PENDULA_INCLUDE_DIR}/pendula/kernels/${name}.hpp")
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
  foreach(kind IN ITEMS planar spatial system)
    set(${kind}_tables "")
    set(${kind}_count 0)
  endforeach()
  foreach(kernel IN LISTS PENDULA_KERNELS)
    pendula_kernel_name("${kernel}" name struct)
    if(kernel MATCHES "^(planar|spatial):")
      set(kind "${CMAKE_MATCH_1}")
    else()
      set(kind system)
      set(struct "${name}_kernel")
    endif()
    configure_file("${PROJECT_SOURCE_DIR}/cmake/kernel.cpp.in" "${folder}/kernel_${name}.cpp" @ONLY)
    list(APPEND sources "${folder}/kernel_${name}.cpp")
    string(APPEND declarations "extern const SystemTable table_${name};\n")
    string(APPEND ${kind}_tables "    &registry::table_${name},\n")
    math(EXPR ${kind}_count "${${kind}_count} + 1")
  endforeach()
  configure_file("${PROJECT_SOURCE_DIR}/cmake/library.cpp.in" "${folder}/library.cpp" @ONLY)
  set(${out_sources} ${sources} "${folder}/library.cpp" PARENT_SCOPE)
endfunction()

# What to run to write generated/ afresh; a build never does it by itself.
function(pendula_add_refresh_target)
  pendula_find_python("${PENDULA_CODEGEN_DIR}/requirements-dev.txt" python problem)  # SymPy of one version
  if(problem)
    add_custom_target(
      refresh-generated
      COMMAND "${CMAKE_COMMAND}" -E echo
              "refresh-generated: expected the packages that made generated/; scripts/setup --tests installs them"
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
