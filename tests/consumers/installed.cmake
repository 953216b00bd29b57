# A project that knows nothing but an installed pendula: one kernel from there, one generated into its own build.
include("${CMAKE_CURRENT_LIST_DIR}/steps.cmake")

take_project(installed)
list(APPEND configure -D "CMAKE_PREFIX_PATH=${prefix}")
step(${configure})
step(${build})
step("${project}-build/swing")
message(STATUS "${output}")
require_no_path_of_checkout("${project}-build")

# As the tutorial says it, in a home with that install, and the Python of its setup.
file(STRINGS "${SOURCE}/docs/tutorials/cpp.md" line REGEX "^cmake -B build ")
cmake_path(GET python PARENT_PATH environment)
cmake_path(GET environment PARENT_PATH environment)
if(EXISTS "${environment}/pyvenv.cfg")
  file(MAKE_DIRECTORY "${WORK}/home")
  file(CREATE_LINK "${prefix}" "${WORK}/home/.local" SYMBOLIC)
  file(CREATE_LINK "${environment}" "${prefix}/share/pendula/venv" SYMBOLIC)
  step("${CMAKE_COMMAND}" -E env "HOME=${WORK}/home" "CXX=${CXX}" sh -c "cd '${project}' && ${line}")
  file(REMOVE "${prefix}/share/pendula/venv")
endif()

if(NOT EXISTS "${project}-build/pendula_kernels/pendula/kernels/spatial_4.hpp")
  message(FATAL_ERROR "spatial_4.hpp was not generated into the consumer's build")
elseif(EXISTS "${project}-build/pendula_kernels/pendula/kernels/planar_2.hpp")
  message(FATAL_ERROR "planar_2.hpp was made again, although the package brings it")
endif()

# Wrong arguments are named.
foreach(case IN ITEMS "swing SPACE spatial LINKS 0|expected a number of links, 1 or more, got \"0\""
                      "swing SPACE spacial LINKS 4|expected the space planar or spatial, got \"spacial\""
                      "swing SPACE spatial|LINKS is missing" "swing LINKS 4|SPACE is missing"
                      "swang SPACE spatial LINKS 4|there is no target \"swang\""
                      "swing SPACE spatial LINK 4|unknown argument \"LINK;4\""
                      "pendula::pendula SPACE spatial LINKS 4|is imported or an alias")
  string(REGEX MATCH "^([^|]*)\\|(.*)$" matched "${case}")
  step_fails("${CMAKE_MATCH_2}" ${configure} -D "EXTRA_ARGUMENTS=${CMAKE_MATCH_1}")
endforeach()
