# One program against one installed pendula, compiled with all kinds of flags that change what Eigen and the standard
# library look like in memory: what passes between the two must not depend on them.
include("${CMAKE_CURRENT_LIST_DIR}/steps.cmake")

take_project(flags)
list(APPEND configure -D "CMAKE_PREFIX_PATH=${prefix}" -D CMAKE_BUILD_TYPE=)  # each program has flags of its own
step(${configure})
step(${build})
file(GLOB programs "${project}-build/bin/*")
list(LENGTH programs count)
if(count LESS 7)
  message(FATAL_ERROR "expected a program for each of at least 6 kinds of flags, and a stepper, got ${programs}")
endif()
foreach(program IN LISTS programs)
  step("${program}")
  message(STATUS "${output}")
endforeach()
