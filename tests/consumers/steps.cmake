# What the consumer tests share. Each is run as cmake -D SOURCE=… -D BUILD=… -D WORK=… -P <test>.cmake.
set(prefix "${WORK}/prefix")

# Runs a command; where it fails, shows what it printed and ends the test. Sets `output` in the caller.
function(step)
  list(JOIN ARGN " " command)
  message(STATUS "${command}")
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT result EQUAL 0)
    message("${output}")
    message(FATAL_ERROR "failed (${result}): ${command}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

# Runs a command that must fail, and say so in words that match EXPECTED.
function(step_fails expected)
  list(JOIN ARGN " " command)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  string(REGEX REPLACE "[ \n]+" " " output "${output}")
  if(result EQUAL 0 OR NOT output MATCHES "${expected}")
    message(FATAL_ERROR "expected \"${expected}\" and a failure from: ${command}\ngot (${result}): ${output}")
  endif()
endfunction()

# The Python by a path that does not lead through the checkout: its virtual environment under a name in WORK.
function(python_out_of_sight out_python)
  get_filename_component(bin "${PYTHON}" DIRECTORY)
  get_filename_component(environment "${bin}" DIRECTORY)
  if(NOT EXISTS "${environment}/pyvenv.cfg")
    set(${out_python} "${PYTHON}" PARENT_SCOPE)
    return()
  endif()
  file(CREATE_LINK "${environment}" "${WORK}/python" SYMBOLIC)
  get_filename_component(name "${PYTHON}" NAME)
  set(${out_python} "${WORK}/python/bin/${name}" PARENT_SCOPE)
endfunction()

# Copies the project FOLDER, by its name one of this folder, to WORK and sets `configure` and `build` to the commands that
# make it.
macro(take_project folder)
  set(original "${folder}")
  cmake_path(ABSOLUTE_PATH original BASE_DIRECTORY "${CMAKE_CURRENT_LIST_DIR}")
  cmake_path(GET original FILENAME project)
  set(project "${WORK}/${project}")
  file(REMOVE_RECURSE "${project}" "${project}-build")
  file(COPY "${original}/" DESTINATION "${project}")
  python_out_of_sight(python)
  set(configure "${CMAKE_COMMAND}" -S "${project}" -B "${project}-build" -G "${GENERATOR}" -D CMAKE_BUILD_TYPE=Debug
                -D "CMAKE_CXX_COMPILER=${CXX}" -D "PENDULA_PYTHON=${python}")
  set(build "${CMAKE_COMMAND}" --build "${project}-build" --parallel 2)
endmacro()

# Fails where a file below FOLDER holds the path of the checkout or of its build.
function(require_no_path_of_checkout folder)
  execute_process(COMMAND grep -rlaF -e "${SOURCE}" -e "${BUILD}" "${folder}" RESULT_VARIABLE result
                  OUTPUT_VARIABLE found ERROR_VARIABLE error)
  if(result EQUAL 0)
    message(FATAL_ERROR "these files lead back to ${SOURCE} or ${BUILD}:\n${found}")
  elseif(NOT result EQUAL 1)
    message(FATAL_ERROR "grep failed: ${error}")
  endif()
endfunction()
