# Flags of this project's own targets. Nothing here reaches a consumer.
include_guard(GLOBAL)
include(CheckCXXCompilerFlag)

# Tests and benchmarks look at the headers as a program that is compiled for this machine has them; nobody carries them
# elsewhere. The library and the program `pendula` run on any processor (PendulaLibrary.cmake).
if(CMAKE_CROSSCOMPILING)
  set(_pendula_native_default OFF)
else()
  set(_pendula_native_default ON)
endif()
option(PENDULA_NATIVE "Compile tests and benchmarks for this machine's processor (-march=native)"
       ${_pendula_native_default})
option(PENDULA_WARNINGS_AS_ERRORS "Treat warnings in pendula's own sources as errors" ${PROJECT_IS_TOP_LEVEL})
option(PENDULA_JOIN_SOURCES "compile the program's sources many at once: a whole build is quicker, one after a small change slower" ON)
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
# -Wmaybe-uninitialized: g++ does not see that a loop over stages runs once at least (14). Sanitizers, with storage that
# begins as NaN, look for what it warns of.
# -Wuninitialized: g++ 12 takes the undefined registers of its own AVX-512 headers for somebody's mistake.
set(_pendula_warnings
    -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wold-style-cast -Wcast-qual -Wnon-virtual-dtor
    -Woverloaded-virtual -Wextra-semi -Wimplicit-fallthrough -Wunused
    "$<$<CXX_COMPILER_ID:GNU>:-Wduplicated-cond;-Wlogical-op;-Wno-array-bounds;-Wno-stringop-overread;-Wno-maybe-uninitialized>"
    "$<$<CXX_COMPILER_ID:Clang>:-Wshadow-uncaptured-local>"
    "$<$<AND:$<CXX_COMPILER_ID:GNU>,$<VERSION_LESS:$<CXX_COMPILER_VERSION>,13>>:-Wno-uninitialized>"
    $<$<BOOL:${PENDULA_WARNINGS_AS_ERRORS}>:-Werror>)
# Not asked for: what AddressSanitizer (null, object-size) and vector loads (alignment) trap by themselves. Those are most
# of what UndefinedBehaviorSanitizer puts in, and a third of the compile time. Nor numbers too large for an integer, of
# which xsimd makes some that it does not use (exp of what is no number).
# Nor use of a stack frame after its return: g++ lays such frames out misaligned for AVX-512 (its bug 110027).
set(_pendula_sanitizers -fsanitize=address,undefined -fno-sanitize=null,object-size,alignment,vptr,float-cast-overflow
                        -fno-sanitize-recover=all -fno-omit-frame-pointer
                        $<$<CXX_COMPILER_ID:GNU>:--param=asan-use-after-return=0>)

# Compiles a target of this project by the project's own rules; for this machine alone where NATIVE is given. Sources of
# one that is JOINED are compiled many at once where PENDULA_JOIN_SOURCES is on: more than half of what each of them takes
# is reading the same headers. No time of a run is spent in them, so they are optimised less in releases, by LEVEL, -O2 if
# not given. Ten sources of cli, by g++ 12: 49 s by -O3, 38 s by -O2, 29 s by -O1.
function(pendula_own_target target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "NATIVE;JOINED" "LEVEL" "")
  target_compile_features(${target} PUBLIC cxx_std_20)
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF UNITY_BUILD OFF)
  target_compile_options(${target} PRIVATE ${_pendula_warnings} $<$<BOOL:${arg_NATIVE}>:${_pendula_native_flags}>)
  if(arg_JOINED)
    if(NOT arg_LEVEL)
      set(arg_LEVEL -O2)
    endif()
    target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:${arg_LEVEL}>)
  endif()
  if(arg_JOINED AND PENDULA_JOIN_SOURCES)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 15)
    # There a name of one source may hide one of another; tests/lint.cmake looks at each source alone.
    target_compile_options(${target} PRIVATE -Wno-shadow)
  endif()
  if(PENDULA_CHECKED)
    target_compile_options(${target} PRIVATE ${_pendula_sanitizers})
    target_compile_definitions(${target} PRIVATE _GLIBCXX_ASSERTIONS EIGEN_INITIALIZE_MATRICES_BY_NAN)
    target_link_options(${target} PUBLIC ${_pendula_sanitizers})
  endif()
endfunction()

function(pendula_say_what_is_built)
  list(JOIN PENDULA_ARCHS " " archs)
  list(JOIN PENDULA_KERNELS " " kernels)
  message(STATUS "pendula ${PROJECT_VERSION}: ${CMAKE_BUILD_TYPE}, for ${archs}")
  message(STATUS "pendula kernels: ${kernels}")
endfunction()
