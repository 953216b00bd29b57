# An install of this build, for the consumers beside this file.
include("${CMAKE_CURRENT_LIST_DIR}/steps.cmake")

file(REMOVE_RECURSE "${WORK}")
file(MAKE_DIRECTORY "${WORK}")
step("${CMAKE_COMMAND}" --install "${BUILD}" --prefix "${prefix}")
step("${prefix}/bin/pendula" --version)
require_no_path_of_checkout("${prefix}")
