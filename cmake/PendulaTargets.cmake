# Flags of this project's own targets. Nothing here reaches a consumer, but for what the end of this file explains.
include_guard(GLOBAL)
include(CheckCXXCompilerFlag)

# A build for this machine is the default only where nobody means to carry the result elsewhere: pendula is the project
# being built, not a part of one, and no install prefix was asked for, as every packager does.
if(PROJECT_IS_TOP_LEVEL AND CMAKE_INSTALL_PREFIX_INITIALIZED_TO_DEFAULT AND NOT CMAKE_CROSSCOMPILING)
  set(_pendula_native_default ON)
else()
  set(_pendula_native_default OFF)
endif()
option(PENDULA_NATIVE "Compile for this machine's processor (-march=native)" ${_pendula_native_default})
option(PENDULA_WARNINGS_AS_ERRORS "Treat warnings in pendula's own sources as errors" ${PROJECT_IS_TOP_LEVEL})
option(PENDULA_CHECKED "Sanitizers (address, undefined), library assertions, new Eigen storage filled with NaN" OFF)

if(PROJECT_IS_TOP_LEVEL)
  get_property(_pendula_multi_config GLOBAL PROPERTY GENERATOR_IS_MULTI_CONFIG)
  if(NOT _pendula_multi_config AND NOT CMAKE_BUILD_TYPE)
    set(CMAKE_BUILD_TYPE Release CACHE STRING "Debug, Release, RelWithDebInfo or MinSizeRel" FORCE)
  endif()
  set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
  find_program(CCACHE_PROGRAM ccache)
  mark_as_advanced(CCACHE_PROGRAM)
  if(CCACHE_PROGRAM AND NOT DEFINED CMAKE_CXX_COMPILER_LAUNCHER)
    set(CMAKE_CXX_COMPILER_LAUNCHER "${CCACHE_PROGRAM}")
  endif()
endif()

set(_pendula_native_flags "")
if(PENDULA_NATIVE)
  check_cxx_compiler_flag(-march=native PENDULA_HAS_MARCH_NATIVE)
  check_cxx_compiler_flag(-mcpu=native PENDULA_HAS_MCPU_NATIVE)
  if(PENDULA_HAS_MARCH_NATIVE)
    set(_pendula_native_flags -march=native)
  elseif(PENDULA_HAS_MCPU_NATIVE)
    set(_pendula_native_flags -mcpu=native)
  else()
    message(FATAL_ERROR "pendula: ${CMAKE_CXX_COMPILER} knows neither -march=native nor -mcpu=native; "
                        "configure with -DPENDULA_NATIVE=OFF")
  endif()
endif()

# -Warray-bounds, -Wstringop-overread (g++ 14): g++ at -O3 takes vectorised copies of Eigen's short vectors for reads
# beyond their end.
# -Wuninitialized: g++ 12 takes the undefined registers of its own AVX-512 headers for somebody's mistake.
set(_pendula_warnings
    -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wold-style-cast -Wcast-qual -Wnon-virtual-dtor
    -Woverloaded-virtual -Wextra-semi -Wimplicit-fallthrough -Wunused
    "$<$<CXX_COMPILER_ID:GNU>:-Wduplicated-cond;-Wlogical-op;-Wno-array-bounds;-Wno-stringop-overread>"
    "$<$<AND:$<CXX_COMPILER_ID:GNU>,$<VERSION_LESS:$<CXX_COMPILER_VERSION>,13>>:-Wno-uninitialized;-Wno-maybe-uninitialized>"
    $<$<BOOL:${PENDULA_WARNINGS_AS_ERRORS}>:-Werror>)
# Not asked for: what AddressSanitizer (null, object-size) and vector loads (alignment) trap by themselves. Those are most
# of what UndefinedBehaviorSanitizer puts in, and a third of the compile time.
set(_pendula_sanitizers -fsanitize=address,undefined -fno-sanitize=null,object-size,alignment,vptr
                        -fno-sanitize-recover=all -fno-omit-frame-pointer)

# Compiles a target of this project by the project's own rules.
function(pendula_own_target target)
  target_compile_features(${target} PUBLIC cxx_std_20)
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF)
  target_compile_options(${target} PRIVATE ${_pendula_warnings} ${_pendula_native_flags})
  if(PENDULA_CHECKED)
    target_compile_options(${target} PRIVATE ${_pendula_sanitizers})
    target_compile_definitions(${target} PRIVATE _GLIBCXX_ASSERTIONS EIGEN_INITIALIZE_MATRICES_BY_NAN)
    target_link_options(${target} PUBLIC ${_pendula_sanitizers})
  endif()
endfunction()

# How Eigen aligns and allocates depends on the vector instructions of each translation unit: memory that the library
# allocates under -march=native and a program without it frees would be freed at the wrong address. What the compiled
# library was built with is therefore written down: <pendula/abi.hpp> compares it at compile time in every program, and
# a library built for this machine hands its two alignments (not its instructions) to those who link it. A portable
# library hands out nothing.
function(pendula_read_alignment out_heap out_fixed)
  if(NOT DEFINED PENDULA_ALIGNMENT_KEY OR NOT PENDULA_ALIGNMENT_KEY STREQUAL "${_pendula_native_flags} ${CMAKE_CXX_FLAGS}")
    set(probe "${PROJECT_BINARY_DIR}/CMakeFiles/pendula_alignment")
    get_target_property(include Eigen3::Eigen INTERFACE_INCLUDE_DIRECTORIES)
    try_compile(compiled "${probe}" "${PROJECT_SOURCE_DIR}/cmake/alignment.cpp"
                CMAKE_FLAGS "-DINCLUDE_DIRECTORIES=${include}"
                COMPILE_DEFINITIONS ${_pendula_native_flags} COPY_FILE "${probe}/alignment" OUTPUT_VARIABLE output)
    if(NOT compiled)
      message(FATAL_ERROR "pendula: a program that includes Eigen/Core does not compile:\n${output}")
    endif()
    file(STRINGS "${probe}/alignment" heap REGEX "pendula-heap-alignment=[0-9]+;")
    file(STRINGS "${probe}/alignment" fixed REGEX "pendula-fixed-alignment=[0-9]+;")
    string(REGEX REPLACE ".*pendula-heap-alignment=([0-9]+).*" "\\1" heap "${heap}")
    string(REGEX REPLACE ".*pendula-fixed-alignment=([0-9]+).*" "\\1" fixed "${fixed}")
    set(PENDULA_HEAP_ALIGNMENT "${heap}" CACHE INTERNAL "EIGEN_DEFAULT_ALIGN_BYTES of this build")
    set(PENDULA_FIXED_ALIGNMENT "${fixed}" CACHE INTERNAL "EIGEN_MAX_STATIC_ALIGN_BYTES of this build")
    set(PENDULA_ALIGNMENT_KEY "${_pendula_native_flags} ${CMAKE_CXX_FLAGS}" CACHE INTERNAL "flags that these belong to")
  endif()
  set(${out_heap} "${PENDULA_HEAP_ALIGNMENT}" PARENT_SCOPE)
  set(${out_fixed} "${PENDULA_FIXED_ALIGNMENT}" PARENT_SCOPE)
endfunction()

function(pendula_state_alignment target)
  pendula_read_alignment(PENDULA_HEAP_ALIGNMENT PENDULA_FIXED_ALIGNMENT)
  configure_file("${PROJECT_SOURCE_DIR}/cmake/abi.hpp.in" "${PENDULA_INCLUDE_DIR}/pendula/abi.hpp" @ONLY)
  if(PENDULA_NATIVE)
    target_compile_definitions(${target} PUBLIC EIGEN_MAX_ALIGN_BYTES=${PENDULA_HEAP_ALIGNMENT}
                                                EIGEN_MAX_STATIC_ALIGN_BYTES=${PENDULA_FIXED_ALIGNMENT})
  endif()
endfunction()

function(pendula_say_what_is_built)
  set(processor "any processor of its kind")
  if(PENDULA_NATIVE)
    set(processor "this machine's processor (PENDULA_NATIVE)")
  endif()
  list(JOIN PENDULA_KERNELS " " kernels)
  message(STATUS "pendula ${PROJECT_VERSION}: ${CMAKE_BUILD_TYPE}, for ${processor}")
  message(STATUS "pendula kernels: ${kernels}")
endfunction()
