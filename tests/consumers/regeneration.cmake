# A kernel made at build time is made again when the generator changes, and only then.
include("${CMAKE_CURRENT_LIST_DIR}/steps.cmake")

take_project(regeneration)
file(COPY "${prefix}/share/pendula/codegen" DESTINATION "${project}")
list(APPEND configure -D "CMAKE_PREFIX_PATH=${prefix}" -D "PENDULA_CODEGEN_DIR=${project}/codegen")
set(made "${project}-build/pendula_kernels/pendula/kernels/planar_5.hpp" "${project}-build/weights"
         "${project}-build/pendula_kernels/pendula/kernels/planar_6.hpp")

# When the files of `made` were written, to the microsecond.
function(read_times out_times)
  set(times "")
  foreach(file IN LISTS made)
    file(TIMESTAMP "${file}" time "%s.%f")
    list(APPEND times "${time}")
  endforeach()
  set(${out_times} "${times}" PARENT_SCOPE)
endfunction()

function(expect_made_again before after)
  foreach(file was is IN ZIP_LISTS made before after)
    if(was STREQUAL is)
      message(FATAL_ERROR "${file} was not made again")
    endif()
  endforeach()
endfunction()

step(${configure})
step(${build})
read_times(first)

step(${build})
read_times(second)
if(NOT first STREQUAL second)
  message(FATAL_ERROR "a second build made something again: ${made}\n${first}\n${second}\n${output}")
endif()

file(APPEND "${project}/codegen/pendula_codegen/links/planar.py" "\n# An edit.\n")
step(${build})
read_times(third)
expect_made_again("${second}" "${third}")

step(${build})
read_times(fourth)
if(NOT third STREQUAL fourth)
  message(FATAL_ERROR "a build after the edit was built made something again:\n${third}\n${fourth}\n${output}")
endif()

# The generator's complaint ends the build, and leaves no header behind.
file(APPEND "${project}/codegen/pendula_codegen/links/planar.py" "\nMODEL = None\n")
step_fails("planar" ${build})
