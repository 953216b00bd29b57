# The laboratory's module: pendula.h and what is behind it, by emscripten. Its flags, and its C++ library, are its own; so it
# is compiled by commands, beside all targets of this build.
include_guard(GLOBAL)

find_program(PENDULA_EMXX em++ DOC "Compiler to WebAssembly (Debian: emscripten), for `pendula lab`")
set(_pendula_lab "")
if(PENDULA_EMXX)
  set(_pendula_lab ON)
endif()
set(PENDULA_LAB "" CACHE STRING "The laboratory: ON or OFF; empty where emscripten is found")
if(NOT PENDULA_LAB STREQUAL "")
  set(_pendula_lab "${PENDULA_LAB}")
  if(PENDULA_LAB AND NOT PENDULA_EMXX)
    message(FATAL_ERROR "PENDULA_LAB: em++ was not found; scripts/setup --web installs emscripten")
  endif()
endif()

# Sets OUT_MODULE to the WebAssembly; empty where it is not built.
function(_pendula_lab_module out_module)
  set(${out_module} "" PARENT_SCOPE)
  if(NOT _pendula_lab)
    return()
  endif()
  set(folder "${PROJECT_BINARY_DIR}/lab")
  set(source "${PROJECT_SOURCE_DIR}/src")
  # Headers alone, without those of this machine's C library, which lie in the same folder.
  get_target_property(eigen Eigen3::Eigen INTERFACE_INCLUDE_DIRECTORIES)
  list(GET eigen 0 eigen)
  get_target_property(boost Boost::headers INTERFACE_INCLUDE_DIRECTORIES)
  list(GET boost 0 boost)
  file(MAKE_DIRECTORY "${folder}/include")
  file(CREATE_LINK "${eigen}/Eigen" "${folder}/include/Eigen" SYMBOLIC)
  file(CREATE_LINK "${boost}/boost" "${folder}/include/boost" SYMBOLIC)
  file(CREATE_LINK "${XSIMD_INCLUDE_DIR}/xsimd" "${folder}/include/xsimd" SYMBOLIC)
  file(TOUCH "${folder}/include/mmintrin.h")  # Eigen asks for it beside SSE2's, which emscripten has

  file(GLOB sources CONFIGURE_DEPENDS "${source}/lab/*.cpp" "${source}/front/*.cpp" "${source}/pendula/run/*.cpp")
  list(FILTER sources EXCLUDE REGEX "/(front/propagate|front/derivatives|run/library|run/feedback|run/derivatives)\\.cpp$")
  foreach(name IN ITEMS pendula/system/interpreted_kernel pendula/system/kernel_text library/interpreter
                        library/orthonormal io/line_file io/output_error io/trajectory)
    list(APPEND sources "${source}/${name}.cpp")
  endforeach()

  # SSE2 is what xsimd knows of 128 bits: emscripten makes WebAssembly's own of it. Eigen would write assembler there.
  set(flags -std=c++20 -O2 -fwasm-exceptions -msimd128 -msse2)
  set(objects "")
  foreach(file IN LISTS sources)
    file(RELATIVE_PATH name "${source}" "${file}")
    string(REPLACE "/" "_" flat "${name}")
    set(object "${folder}/${flat}.o")
    add_custom_command(
      OUTPUT "${object}"
      COMMAND
        "${PENDULA_EMXX}" ${flags} -DNDEBUG -DEIGEN_DONT_VECTORIZE -include "${source}/lab/older_library.hpp" -I
        "${source}" -I "${PENDULA_INCLUDE_DIR}" -isystem "${folder}/include" -MD -MF "${object}.d" -c -o "${object}"
        "${file}"
      DEPENDS "${file}" pendula_kernel_headers
      DEPFILE "${object}.d"
      COMMENT "Compiling ${name} to WebAssembly" VERBATIM)
    list(APPEND objects "${object}")
  endforeach()
  set(exports _malloc _free)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${source}/lab/exports.txt")
  file(STRINGS "${source}/lab/exports.txt" names)
  list(TRANSFORM names PREPEND _)
  list(APPEND exports ${names})
  list(JOIN exports "," exports)
  add_custom_command(
    OUTPUT "${folder}/module.wasm"
    COMMAND "${PENDULA_EMXX}" ${flags} -o "${folder}/module.wasm" ${objects} -sSTANDALONE_WASM --no-entry
            -sALLOW_MEMORY_GROWTH -sFILESYSTEM=0 "-sEXPORTED_FUNCTIONS=${exports}"
    DEPENDS ${objects}
    COMMENT "Linking the laboratory's module" VERBATIM)
  set(${out_module} "${folder}/module.wasm" PARENT_SCOPE)
endfunction()

# Sets OUT_SOURCE to a C++ file with what the laboratory's page is made of: FOLDER has its sources, PAGES those of other
# pages, some of which it shares.
function(pendula_lab_assets folder pages out_source)
  _pendula_lab_module(module)
  set(models "")
  pendula_find_python("${PENDULA_CODEGEN_DIR}/requirements.txt" python problem)
  if(module AND NOT problem)
    set(models "${PROJECT_BINARY_DIR}/lab/models.json")
    file(GLOB_RECURSE generator CONFIGURE_DEPENDS "${PENDULA_CODEGEN_DIR}/pendula_codegen/*.py")
    add_custom_command(
      OUTPUT "${models}"
      COMMAND "${python}" -B "${PROJECT_SOURCE_DIR}/cmake/lab_models.py" "${PENDULA_CODEGEN_DIR}" "${models}"
      DEPENDS ${generator} "${PROJECT_SOURCE_DIR}/cmake/lab_models.py"
      COMMENT "Deriving the laboratory's models" VERBATIM)
  endif()
  set(output "${PROJECT_BINARY_DIR}/view/lab_assets.cpp")
  file(GLOB_RECURSE files CONFIGURE_DEPENDS "${folder}/*" "${pages}/*")
  add_custom_command(
    OUTPUT "${output}"
    COMMAND "${CMAKE_COMMAND}" -D FOLDER=${folder} -D PAGES=${pages} -D MODULE=${module} -D MODELS=${models}
            -D OUTPUT=${output}
            -P "${PROJECT_SOURCE_DIR}/cmake/embed_lab.cmake"
    DEPENDS ${files} ${module} ${models} "${PROJECT_SOURCE_DIR}/cmake/embed_lab.cmake"
            "${PROJECT_SOURCE_DIR}/cmake/embed_bytes.cmake"
    COMMENT "Embedding the sources of the laboratory" VERBATIM)
  set(${out_source} "${output}" PARENT_SCOPE)
endfunction()
