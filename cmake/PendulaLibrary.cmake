# The compiled library: all of src/library, once for each instruction set, in one static library; which copy runs is
# decided when the program does (src/pendula/run/library.cpp).
#
# Code compiled for AVX-512 must not be what a linker takes for some inline function that other code uses, too: a machine
# without AVX-512 would die there. Nor may a program's copy of such a function, compiled with other flags, be what the
# library uses: how Eigen allocates depends on them. So each copy is sealed: its objects are linked into one, whose
# symbols are all made local but the functions `copy_of`, which give its parts (library_copies.hpp.in). What passes through
# those is in library.hpp. Sections stay apart, so that a linker can leave out what nobody needs.
include_guard(GLOBAL)

# Stages of the chain integrators, those of one translation unit in one item.
set(_pendula_chain_stages "1 2 3 4" "5 6" "7 8")

# Flags of each copy: no vector instructions but those that src/pendula/run/library.cpp asks the processor for, whatever
# CMAKE_CXX_FLAGS say before, -march=native or -mavx. Without SSE3 there is nothing above it.
set(_pendula_flags_sse2 -march=x86-64 -mno-sse3)
set(_pendula_flags_avx2 ${_pendula_flags_sse2} -mavx2 -mfma)
set(_pendula_flags_avx512 ${_pendula_flags_avx2} -mavx512f -mavx512cd -mavx512dq -mavx512bw -mavx512vl)
set(_pendula_flags_baseline "")

# Instruction sets that this compiler can make code for, from the least to the best.
function(_pendula_possible_archs out_archs)
  include(CheckCXXSourceCompiles)
  check_cxx_source_compiles("#ifndef __x86_64__\n#error\n#endif\nint main() {}" PENDULA_X86_64)
  check_cxx_source_compiles("#ifndef __ELF__\n#error\n#endif\nint main() {}" PENDULA_ELF)
  if(PENDULA_X86_64 AND NOT PENDULA_CHECKED)
    set(${out_archs} sse2 avx2 avx512 PARENT_SCOPE)
  else()
    set(${out_archs} baseline PARENT_SCOPE)
  endif()
endfunction()

# The best of ARCHS that this machine's processor has: the compiler says which features that are.
function(_pendula_native_arch out_arch archs)
  list(GET archs 0 best)
  set(macros "")
  if(NOT best STREQUAL "baseline")
    if(CMAKE_CROSSCOMPILING)
      message(FATAL_ERROR "PENDULA_ARCHS: expected some of ${archs}, got native, which says nothing of another machine")
    endif()
    execute_process(COMMAND "${CMAKE_CXX_COMPILER}" -march=native -dM -E -x c++ /dev/null OUTPUT_VARIABLE macros
                    COMMAND_ERROR_IS_FATAL ANY)
  endif()
  foreach(arch IN LISTS archs)
    set(wanted "${_pendula_flags_${arch}}")
    list(FILTER wanted INCLUDE REGEX "^-m(avx|fma)")
    set(has_all TRUE)
    foreach(flag IN LISTS wanted)
      string(REGEX REPLACE "^-m" "" feature "${flag}")
      string(TOUPPER "__${feature}__" macro)
      if(NOT macros MATCHES "#define ${macro} ")
        set(has_all FALSE)
      endif()
    endforeach()
    if(has_all)
      set(best ${arch})
    endif()
  endforeach()
  set(${out_arch} ${best} PARENT_SCOPE)
endfunction()

_pendula_possible_archs(_pendula_archs)
if(NOT "$ENV{PENDULA_ARCHS}" STREQUAL "")
  set(_pendula_default "$ENV{PENDULA_ARCHS}")
elseif(PROJECT_IS_TOP_LEVEL AND NOT CMAKE_CROSSCOMPILING)
  set(_pendula_default native)
else()
  set(_pendula_default "${_pendula_archs}")  # it is not known where that program will run
endif()
set(PENDULA_ARCHS "${_pendula_default}" CACHE STRING
    "Instruction sets to compile the library for, of ${_pendula_archs}; native: the best one of this machine")
set(_pendula_wanted "")
foreach(arch IN LISTS PENDULA_ARCHS)
  if(arch STREQUAL "native")
    _pendula_native_arch(arch "${_pendula_archs}")
  elseif(NOT arch IN_LIST _pendula_archs)
    message(FATAL_ERROR "PENDULA_ARCHS: expected native or some of ${_pendula_archs}, got \"${arch}\"")
  endif()
  list(APPEND _pendula_wanted ${arch})
endforeach()
set(_pendula_chosen "")  # each once, from the least to the best
foreach(arch IN LISTS _pendula_archs)
  if(arch IN_LIST _pendula_wanted)
    list(APPEND _pendula_chosen ${arch})
  endif()
endforeach()
if(_pendula_chosen STREQUAL "")
  message(FATAL_ERROR "PENDULA_ARCHS: expected native or some of ${_pendula_archs}, got none")
endif()
set(PENDULA_ARCHS "${_pendula_chosen}")

# Whether copies can be sealed here: by GNU ld, by way of the compiler, which knows what it has to be told. They have to
# be where there are several, or how Eigen allocates depends on flags.
function(_pendula_check_seal)
  if(NOT PENDULA_ELF AND NOT PENDULA_X86_64)
    return()
  endif()
  execute_process(COMMAND "${CMAKE_CXX_COMPILER}" -fuse-ld=bfd -Wl,--help OUTPUT_VARIABLE help ERROR_VARIABLE error)
  if(NOT help MATCHES "--force-group-allocation" OR NOT CMAKE_OBJCOPY OR NOT CMAKE_OBJDUMP)
    message(FATAL_ERROR "pendula: GNU ld (2.29 or later), objcopy and objdump are needed (Debian: binutils); got\n"
                        "${CMAKE_CXX_COMPILER} -fuse-ld=bfd -Wl,--help: ${error}\n"
                        "objcopy: ${CMAKE_OBJCOPY}, objdump: ${CMAKE_OBJDUMP}")
  endif()
endfunction()

# Translation units of the chain integrators. Sets OUT_SOURCES.
function(pendula_chain_sources out_sources)
  set(sources "")
  foreach(space IN ITEMS Planar Spatial)
    foreach(stages IN LISTS _pendula_chain_stages)
      string(TOLOWER "${space}_${stages}" name)
      string(REPLACE " " "_" name "${name}")
      set(instances "")
      separate_arguments(numbers NATIVE_COMMAND "${stages}")
      foreach(s IN LISTS numbers)
        string(APPEND instances "template std::unique_ptr<PlainIntegrator> make_chain_stages<${space}, ${s}>("
                                "const Chain<${space}>&, const RunOptions&);\n")
      endforeach()
      set(source "${PROJECT_BINARY_DIR}/kernels/chain_${name}.cpp")
      configure_file("${PROJECT_SOURCE_DIR}/cmake/chain_stages.cpp.in" "${source}" @ONLY)
      list(APPEND sources "${source}")
    endforeach()
  endforeach()
  set(${out_sources} "${sources}" PARENT_SCOPE)
endfunction()

# Compiles SOURCES once for each instruction set and adds the copies to TARGET, which chooses among them on any processor.
function(pendula_add_copies target)
  list(GET _pendula_archs 0 least)
  target_compile_options(${target} PRIVATE ${_pendula_flags_${least}})
  set(declarations "")
  set(names "")
  set(functions "")
  list(LENGTH PENDULA_ARCHS count)
  foreach(arch IN LISTS PENDULA_ARCHS)
    _pendula_compile_copy(pendula_${arch} ${arch} ${ARGN})
    _pendula_seal(${target} pendula_${arch} "_ZN7pendula7copy_of*" pendula_${arch})
    string(APPEND declarations "struct ${arch};\n")
    list(APPEND names "\"${arch}\"")
    list(APPEND functions "&copy_of<Part, ${arch}>")
  endforeach()
  list(JOIN names ", " names)
  list(JOIN functions ", " functions)
  configure_file("${PROJECT_SOURCE_DIR}/cmake/library_copies.hpp.in" "${PROJECT_BINARY_DIR}/kernels/library_copies.hpp"
                 @ONLY)
  target_include_directories(${target} PRIVATE "${PROJECT_BINARY_DIR}/kernels")
endfunction()

function(_pendula_compile_copy copy arch)
  add_library(${copy} OBJECT ${ARGN})
  pendula_own_target(${copy})
  # Sealing needs machine code, and would not make symbols local that a program must have once.
  target_compile_options(${copy} PRIVATE ${_pendula_flags_${arch}} -fno-lto $<$<CXX_COMPILER_ID:GNU>:-fno-gnu-unique>)
  target_compile_definitions(${copy} PRIVATE $<$<BOOL:${PENDULA_CHECKED}>:PENDULA_FEW_LANES>)
  list(GET _pendula_archs 0 least)
  if(PENDULA_CHECKED OR NOT arch STREQUAL least)
    # Without optimisation, Eigen's empty constants would be initialised when a program starts (check_runs_nothing.cmake),
    # and sanitized steps would take minutes.
    target_compile_options(${copy} PRIVATE $<$<NOT:$<CONFIG:Release,RelWithDebInfo,MinSizeRel>>:-O1>)
  endif()
  target_compile_definitions(${copy} PRIVATE PENDULA_INSTRUCTION_SET=${arch})
  target_include_directories(${copy} PRIVATE "${PROJECT_SOURCE_DIR}/src" "${PENDULA_INCLUDE_DIR}"
                                             "${PROJECT_BINARY_DIR}/kernels")
  target_link_libraries(${copy} PRIVATE pendula_kernels pendula::xsimd)
  # A precompiled header holds paths and times: by it ccache would find nothing of what another checkout has compiled.
  if(NOT CMAKE_CXX_COMPILER_LAUNCHER MATCHES "ccache")
    target_precompile_headers(${copy} PRIVATE <Eigen/Dense> <xsimd/xsimd.hpp>)
  endif()
  set_target_properties(${copy} PROPERTIES POSITION_INDEPENDENT_CODE ON INTERPROCEDURAL_OPTIMIZATION OFF)
  list(GET PENDULA_ARCHS 0 first)
  if(NOT arch STREQUAL first)
    set_target_properties(${copy} PROPERTIES EXPORT_COMPILE_COMMANDS OFF)  # the sources are in there once
  endif()
endfunction()

# Links the objects of OBJECT_LIBRARIES into COPY, of which nothing is seen but SYMBOLS, a pattern; adds it to TARGET.
function(_pendula_seal target copy symbols)
  set(objects "")
  foreach(library IN LISTS ARGN)
    # CMake counts precompiled headers among them.
    list(APPEND objects "$<FILTER:$<TARGET_OBJECTS:${library}>,EXCLUDE,cmake_pch>")
  endforeach()
  if(NOT PENDULA_ELF)
    target_sources(${target} PRIVATE ${objects})
    return()
  endif()
  set(sealed "${CMAKE_CURRENT_BINARY_DIR}/$<CONFIG>/${copy}.o")
  add_custom_command(
    OUTPUT "${sealed}"
    COMMAND "${CMAKE_COMMAND}" -E make_directory "${CMAKE_CURRENT_BINARY_DIR}/$<CONFIG>"
    COMMAND "${CMAKE_CXX_COMPILER}" -r -nostdlib -fuse-ld=bfd -Wl,--force-group-allocation
            "-Wl,--unique=.text*,--unique=.data*,--unique=.rodata*" -o "${sealed}.open" ${objects}
    COMMAND "${CMAKE_COMMAND}" -D "OBJECT=${sealed}.open" -D "OBJDUMP=${CMAKE_OBJDUMP}" -D "COPY=${copy}"
            -P "${PROJECT_SOURCE_DIR}/cmake/check_runs_nothing.cmake"
    COMMAND "${CMAKE_OBJCOPY}" --wildcard "--keep-global-symbol=${symbols}" "${sealed}.open" "${sealed}"
    COMMAND "${CMAKE_COMMAND}" -E rm "${sealed}.open"
    DEPENDS ${objects} "${PROJECT_SOURCE_DIR}/cmake/check_runs_nothing.cmake"
    COMMENT "Sealing ${copy}.o" COMMAND_EXPAND_LISTS VERBATIM)
  set_source_files_properties("${sealed}" PROPERTIES EXTERNAL_OBJECT ON GENERATED ON)
  target_sources(${target} PRIVATE "${sealed}")
  add_dependencies(${target} ${ARGN})
endfunction()

# Compiles SOURCES of this project's own, in which Eigen's vectors pass, once, for any processor. Whoever links the objects
# is compiled for the same.
function(pendula_add_objects name)
  list(GET _pendula_archs 0 least)
  add_library(${name} OBJECT ${ARGN})
  pendula_own_target(${name} JOINED)
  target_compile_options(${name} PUBLIC ${_pendula_flags_${least}}
                                 PRIVATE -ffunction-sections -fdata-sections -fno-lto
                                         $<$<CXX_COMPILER_ID:GNU>:-fno-gnu-unique>)
  target_include_directories(${name} PUBLIC "${PROJECT_SOURCE_DIR}/src" "${PENDULA_INCLUDE_DIR}")
  target_link_libraries(${name} PUBLIC pendula_kernels pendula::xsimd)
  set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE ON INTERPROCEDURAL_OPTIMIZATION OFF)
endfunction()

# Adds the objects of OBJECT_LIBRARIES to TARGET, of which nothing is seen but the functions of pendula.h.
function(pendula_add_front target)
  _pendula_seal(${target} pendula_front "pendula_*" ${ARGN})
endfunction()

_pendula_check_seal()
