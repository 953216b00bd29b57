# Fails where an object has code that runs by itself when a program starts, before anybody has looked whether the
# processor can: cmake -D OBJECT=… -D OBJDUMP=… -D COPY=… -P check_runs_nothing.cmake
cmake_minimum_required(VERSION 3.25)
if(COPY MATCHES "_(sse2|baseline|front)$")
  return()  # runs everywhere
endif()
execute_process(COMMAND "${OBJDUMP}" -h "${OBJECT}" OUTPUT_VARIABLE sections COMMAND_ERROR_IS_FATAL ANY)
if(sections MATCHES "\\.(init_array|preinit_array|ctors|init)[. \n]")
  message(FATAL_ERROR "${COPY}: something in src/library or what it includes is initialised when a program starts "
                      "(section .${CMAKE_MATCH_1}): a static variable that is not constinit, or a compiler flag such as "
                      "--coverage; with such a flag configure with -DPENDULA_ARCHS=sse2")
endif()
