# The Python that generates kernels: one that has its packages.
include_guard(GLOBAL)

set(PENDULA_PYTHON "" CACHE FILEPATH "Python with the generator's packages (empty: that of pendula's own setup, else python3)")

# Sets OUT_COMPLAINT to what PYTHON lacks of REQUIREMENTS, empty where it lacks nothing.
function(_pendula_python_complaint python requirements out_complaint)
  execute_process(COMMAND "${python}" "${CMAKE_CURRENT_FUNCTION_LIST_DIR}/check_requirements.py" "${requirements}"
                  RESULT_VARIABLE result OUTPUT_VARIABLE complaint ERROR_VARIABLE error)
  if(result EQUAL 0)
    set(complaint "")
  elseif(complaint STREQUAL "")
    string(STRIP "does not run: ${result} ${error}" complaint)
  endif()
  set(${out_complaint} "${complaint}" PARENT_SCOPE)
endfunction()

# Finds a Python that has all of REQUIREMENTS. On failure OUT_PYTHON is empty and OUT_PROBLEM says what was tried and
# what to run.
function(pendula_find_python requirements out_python out_problem)
  get_filename_component(codegen "${requirements}" DIRECTORY)
  set(candidates "${PENDULA_PYTHON}")
  if(PENDULA_PYTHON STREQUAL "")
    set(candidates "")
    get_filename_component(root "${codegen}/.." ABSOLUTE)
    foreach(own IN ITEMS .venv venv)  # scripts/setup makes the one, setup of an installed pendula the other
      if(EXISTS "${root}/${own}/bin/python")
        list(APPEND candidates "${root}/${own}/bin/python")
      endif()
    endforeach()
    find_package(Python3 QUIET COMPONENTS Interpreter)
    if(Python3_EXECUTABLE)
      list(APPEND candidates "${Python3_EXECUTABLE}")
    endif()
  endif()

  set(tried "")
  foreach(python IN LISTS candidates)
    _pendula_python_complaint("${python}" "${requirements}" complaint)
    if(complaint STREQUAL "")
      set(${out_python} "${python}" PARENT_SCOPE)
      set(${out_problem} "" PARENT_SCOPE)
      return()
    endif()
    string(APPEND tried "\n  ${python}: ${complaint}")
  endforeach()
  if(tried STREQUAL "")
    set(tried "\n  none found")
  endif()
  get_filename_component(own_setup "${codegen}/../setup" ABSOLUTE)  # of an installed pendula
  if(NOT EXISTS "${own_setup}")
    get_filename_component(own_setup "${codegen}/../scripts/setup" ABSOLUTE)
  endif()
  set(${out_python} "" PARENT_SCOPE)
  set(${out_problem} "no Python has the packages of ${requirements}. Tried:${tried}\nRun\n  \
${own_setup}\nor configure with -DPENDULA_PYTHON=<a Python that has them>" PARENT_SCOPE)
endfunction()
