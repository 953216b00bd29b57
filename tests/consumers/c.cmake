# A project in C that knows nothing but an installed pendula: two systems exported into its own build.
include("${CMAKE_CURRENT_LIST_DIR}/steps.cmake")

take_project(c)
list(APPEND configure -D "CMAKE_PREFIX_PATH=${prefix}")
step(${configure})
step(${build})
step("${project}-build/step")
message(STATUS "${output}")
require_no_path_of_checkout("${project}-build")

foreach(case IN ITEMS "step SPACE planar LINKS 2 LANGUAGE Ada|expected the LANGUAGE CXX or C, got \"Ada\"")
  string(REGEX MATCH "^([^|]*)\\|(.*)$" matched "${case}")
  step_fails("${CMAKE_MATCH_2}" ${configure} -D "EXTRA_ARGUMENTS=${CMAKE_MATCH_1}")
endforeach()
