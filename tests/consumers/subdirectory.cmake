# A project that has pendula as a folder of its own.
include("${CMAKE_CURRENT_LIST_DIR}/steps.cmake")

take_project(subdirectory)
# Neither optimised nor for a debugger: the library is compiled here to be linked.
step(${configure} -D CMAKE_BUILD_TYPE= -D "PENDULA_CHECKOUT=${SOURCE}" -D PENDULA_ARCHS=${ARCH})
step(${build})
step("${project}-build/swing")
message(STATUS "${output}")
