# clang-tidy on the sources of the library and the program: cmake -D SOURCE=… -D BUILD=… -D CLANG_TIDY=… -P lint.cmake
cmake_minimum_required(VERSION 3.25)
include(ProcessorCount)
ProcessorCount(jobs)
file(READ "${BUILD}/compile_commands.json" database)
# Sources that are compiled together are looked at together: their headers are read once.
file(GLOB joined "${BUILD}/src/CMakeFiles/*.dir/Unity/*.cxx")
file(GLOB_RECURSE sources "${SOURCE}/src/*.cpp")
# What is compiled for several spaces and numbers of stages is the same lines: once.
list(FILTER sources EXCLUDE REGEX "/library/spatial_")
set(files "")
foreach(source IN LISTS joined sources)  # earlier builds may have left some that are no longer compiled
  string(FIND "${database}" "\"file\": \"${source}\"" place)
  if(place GREATER -1)
    list(APPEND files "${source}")
  endif()
endforeach()
file(GLOB chains "${BUILD}/kernels/chain_spatial_1_*.cpp")
if(chains STREQUAL "")
  message(FATAL_ERROR "expected ${BUILD}/kernels/chain_spatial_1_*.cpp, chain integrators")
endif()
list(APPEND files ${chains})
list(JOIN files "\n" lines)
file(WRITE "${BUILD}/lint.txt" "${lines}\n")
# The compilation database is the compiler's: clang-tidy need not know each of its warnings, nor g++'s symbols, and
# cannot read another compiler's precompiled headers.
string(REPLACE " -fno-gnu-unique" "" database "${database}")
string(REGEX REPLACE " -Winvalid-pch -include [^ ]+" "" database "${database}")
string(REGEX REPLACE " -Winvalid-pch (-Xclang )?-include-pch -Xclang [^ ]+ -Xclang -include -Xclang [^ ]+" "" database
       "${database}")
file(WRITE "${BUILD}/lint/compile_commands.json" "${database}")
execute_process(
  COMMAND xargs -P ${jobs} -n 1 -a "${BUILD}/lint.txt" "${CLANG_TIDY}" --quiet -p "${BUILD}/lint"
          --extra-arg=-Wno-unknown-warning-option --checks=-bugprone-suspicious-include
  RESULT_VARIABLE result OUTPUT_VARIABLE complaints ERROR_VARIABLE notes)
if(NOT result EQUAL 0)
  message("${complaints}\n${notes}")
  message(FATAL_ERROR "clang-tidy complains")
endif()
