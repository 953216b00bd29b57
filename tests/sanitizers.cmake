# The C++ tests in a build with sanitizers: cmake [-D BUILD=…] [-D CXX=…] -P sanitizers.cmake
# By Clang where there is one, else by CXX: Clang compiles them sooner, they run much faster, and a second compiler reads
# what g++ compiles for all other tests.
cmake_minimum_required(VERSION 3.25)
cmake_path(GET CMAKE_CURRENT_LIST_DIR PARENT_PATH source)
if(NOT DEFINED BUILD)
  set(BUILD "${source}/build/asan")
endif()
find_program(CLANG clang++ NO_CACHE)
set(compiler "")
if(CLANG)
  # Nor is what is not in the library worth its optimisation, without which g++ 12 compiles no xsimd 8 for AVX-512.
  set(compiler -D "CMAKE_CXX_COMPILER=${CLANG}" -D "CMAKE_CXX_FLAGS_DEBUG=-O0 -g1")
elseif(DEFINED CXX)
  set(compiler -D "CMAKE_CXX_COMPILER=${CXX}")
endif()
# Sanitized code is compiled once, for this machine: what the library around it is compiled for is another matter.
unset(ENV{PENDULA_ARCHS})
execute_process(COMMAND "${CMAKE_COMMAND}" --preset asan -B "${BUILD}" ${compiler}
                        -D "PENDULA_KERNELS=planar:1\\;planar:2\\;planar:3\\;spatial:2"
                WORKING_DIRECTORY "${source}" COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND "${CMAKE_COMMAND}" --build "${BUILD}" --target cpp_tests --parallel 2
                COMMAND_ERROR_IS_FATAL ANY)
# The long runs repeat what the others do, millions of times: without sanitizers they take seconds, here many minutes. Of
# NarrowEvents and EventsWithinBounds those stay that choose steps.
set(long_runs EnergyAndAngularMomentumAreKept EnergyStaysWhatItIs FullTurnsAreCounted RandomCrossings WhatTurnsOften
              OfAPublishedDoublePendulum ComeInPairs ReachesTheAccuracy NarrowEvents.AreAllFound/gauss_
              NarrowEvents.AreAllFound/[rdfb] NarrowEventsInLanes
              AreThoseThatAreFoundWithout/gauss_ AreThoseThatAreFoundWithout/[rv] AreThoseThatAreFoundWithout/dense_
              TangentsGrowAsThoseOfExplicitSteps)
list(JOIN long_runs "|" long_runs)
execute_process(COMMAND "${CMAKE_CTEST_COMMAND}" --test-dir "${BUILD}" --label-regex cpp --exclude-regex "${long_runs}"
                        --output-on-failure --parallel 2
                COMMAND_ERROR_IS_FATAL ANY)
