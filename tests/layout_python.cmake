# ruff on every Python file: cmake -D SOURCE=… -D PYTHON=… -P layout_python.cmake
cmake_minimum_required(VERSION 3.25)
file(GLOB candidates "${SOURCE}/scripts/*")
set(scripts "")
foreach(file IN LISTS candidates)
  file(STRINGS "${file}" first LIMIT_COUNT 1)
  if(first MATCHES "^#!.*python")
    list(APPEND scripts "${file}")
  endif()
endforeach()
set(elsewhere --config codegen/pyproject.toml plotting python tests cmake docs ${scripts})

# The generator is a package of its own: its imports are sorted as seen from its folder.
set(status 0)
foreach(command IN ITEMS check "format;--check")
  execute_process(COMMAND "${PYTHON}" -m ruff ${command} --no-cache . WORKING_DIRECTORY "${SOURCE}/codegen"
                  RESULT_VARIABLE in_codegen)
  execute_process(COMMAND "${PYTHON}" -m ruff ${command} --no-cache ${elsewhere} WORKING_DIRECTORY "${SOURCE}"
                  RESULT_VARIABLE in_rest)
  if(NOT in_codegen EQUAL 0 OR NOT in_rest EQUAL 0)
    set(status 1)
  endif()
endforeach()
if(status)
  message(FATAL_ERROR "ruff complains")
endif()
