# A project that has pendula as a folder of its own.
include("${CMAKE_CURRENT_LIST_DIR}/steps.cmake")

take_project(subdirectory)
step(${configure} -D "PENDULA_CHECKOUT=${SOURCE}" -D PENDULA_ARCHS=${ARCH})
step(${build})
step("${project}-build/swing")
message(STATUS "${output}")
