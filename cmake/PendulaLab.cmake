# The laboratory: a page that computes motions itself. Committed is the whole page, generated/laboratory.html; a build takes
# from there what needs minutes and more tools than its own, the WebAssembly and the built-in models, and the rest from its
# sources. What is committed is made anew by refresh-generated, and tests/lab compares.
include_guard(GLOBAL)

set(PENDULA_LAB_PAGE "${PENDULA_GENERATED_DIR}/laboratory.html")

# Sets OUT_COMPILER to what compiles the module to the bytes that are committed, empty elsewhere: they depend on Debian 12's
# emscripten, Eigen and xsimd.
function(_pendula_lab_compiler out_compiler)
  find_program(compiler em++ NO_CACHE)
  cmake_host_system_information(RESULT system QUERY DISTRIB_ID)
  cmake_host_system_information(RESULT release QUERY DISTRIB_VERSION_ID)
  if(NOT compiler OR NOT "${system} ${release}" STREQUAL "debian 12")
    set(compiler "")
  endif()
  set(${out_compiler} "${compiler}" PARENT_SCOPE)
endfunction()

# The module: pendula.h and what is behind it, by the COMPILER emscripten. Its flags, and its C++ library, are its own; so it
# is compiled by commands, beside all targets of this build. Sets OUT_MODULE to the WebAssembly.
function(_pendula_lab_module compiler out_module)
  set(folder "${PROJECT_BINARY_DIR}/lab")
  set(source "${PROJECT_SOURCE_DIR}/src")
  # Headers alone, without those of this machine's C library, which lie in the same folder.
  get_target_property(eigen Eigen3::Eigen INTERFACE_INCLUDE_DIRECTORIES)
  list(GET eigen 0 eigen)
  file(MAKE_DIRECTORY "${folder}/include")
  file(CREATE_LINK "${eigen}/Eigen" "${folder}/include/Eigen" SYMBOLIC)
  file(CREATE_LINK "${XSIMD_INCLUDE_DIR}/xsimd" "${folder}/include/xsimd" SYMBOLIC)
  file(TOUCH "${folder}/include/mmintrin.h")  # Eigen asks for it beside SSE2's, which emscripten has

  file(GLOB sources CONFIGURE_DEPENDS "${source}/lab/*.cpp" "${source}/front/*.cpp" "${source}/pendula/run/*.cpp")
  list(FILTER sources EXCLUDE REGEX "/(front/propagate|front/derivatives|run/library|run/feedback|run/derivatives)\\.cpp$")
  foreach(name IN ITEMS pendula/system/interpreted_kernel pendula/system/kernel_text library/interpreter
                        library/orthonormal io/errors io/trajectory)
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
        "${compiler}" ${flags} -DNDEBUG -DEIGEN_DONT_VECTORIZE -include "${source}/lab/older_library.hpp" -I
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
    COMMAND "${compiler}" ${flags} -o "${folder}/module.wasm" ${objects} -sSTANDALONE_WASM --no-entry
            -sALLOW_MEMORY_GROWTH -sFILESYSTEM=0 "-sEXPORTED_FUNCTIONS=${exports}"
    DEPENDS ${objects}
    COMMENT "Linking the laboratory's module" VERBATIM)
  set(${out_module} "${folder}/module.wasm" PARENT_SCOPE)
endfunction()

# Sets OUT_SOURCE to a C++ file with the laboratory's page: FOLDER has its sources, PAGES those of other pages, some of which it
# shares. The target refresh-laboratory writes the committed page afresh; where tests are built, so is what they compare with.
function(pendula_lab_assets folder pages out_source)
  set(output "${PROJECT_BINARY_DIR}/view/lab_assets.cpp")
  set(put_together "${CMAKE_COMMAND}" -D FOLDER=${folder} -D PAGES=${pages} -D KEPT=${PENDULA_LAB_PAGE} -D VERSION=${PROJECT_VERSION})
  set(script "${PROJECT_SOURCE_DIR}/cmake/lab_page.cmake")
  file(GLOB_RECURSE files CONFIGURE_DEPENDS "${folder}/*" "${pages}/*" "${PROJECT_SOURCE_DIR}/src/lab/licences.txt")
  add_custom_command(
    OUTPUT "${output}"
    COMMAND ${put_together} -D PAGE=${PROJECT_BINARY_DIR}/view/laboratory.html -D OUTPUT=${output} -P "${script}"
    DEPENDS ${files} "${PENDULA_LAB_PAGE}" "${script}" "${PROJECT_SOURCE_DIR}/cmake/embed_bytes.cmake"
    COMMENT "Putting the laboratory together" VERBATIM)
  set(${out_source} "${output}" PARENT_SCOPE)

  pendula_find_python("${PENDULA_CODEGEN_DIR}/requirements-dev.txt" python problem)
  if(problem)
    return()  # refresh-generated says so
  endif()
  set(fresh "${PROJECT_BINARY_DIR}/lab/models.json")
  file(MAKE_DIRECTORY "${PROJECT_BINARY_DIR}/lab")
  file(GLOB_RECURSE generator CONFIGURE_DEPENDS "${PENDULA_CODEGEN_DIR}/pendula_codegen/*.py")
  add_custom_command(
    OUTPUT "${fresh}"
    COMMAND "${python}" -B "${PROJECT_SOURCE_DIR}/cmake/lab_models.py" "${PENDULA_CODEGEN_DIR}" "${fresh}"
    DEPENDS ${generator} "${PROJECT_SOURCE_DIR}/cmake/lab_models.py"
    COMMENT "Deriving the laboratory's models" VERBATIM)
  _pendula_lab_compiler(compiler)
  set(kept "")
  if(compiler)
    _pendula_lab_module("${compiler}" module)
    list(APPEND fresh "${module}")
  else()
    set(kept COMMAND "${CMAKE_COMMAND}" -E echo
             "refresh-generated: the laboratory keeps its WebAssembly: that takes Debian 12, with emscripten (scripts/setup --web)")
  endif()
  set(all "")
  if(PENDULA_BUILD_TESTS AND NOT PENDULA_CHECKED)
    set(all ALL)
  endif()
  add_custom_target(pendula_lab_fresh ${all} DEPENDS ${fresh})
  add_custom_target(
    refresh-laboratory
    COMMAND "${python}" -B "${PROJECT_SOURCE_DIR}/cmake/refresh_lab.py" "${PENDULA_LAB_PAGE}" ${fresh}
    COMMAND ${put_together} -D PAGE=${PENDULA_LAB_PAGE} -P "${script}" ${kept}
    DEPENDS ${fresh}
    COMMENT "Writing generated/laboratory.html afresh" VERBATIM USES_TERMINAL)
  add_dependencies(refresh-generated refresh-laboratory)
endfunction()
