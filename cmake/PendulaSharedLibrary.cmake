# libpendula.so: the static library as one for C, and for every language that loads shared libraries. Nothing is compiled for
# it. Of it the functions of pendula.h are seen, under the version PENDULA_<interface>, and nothing of C++.
include_guard(GLOBAL)

# Number of the interface, the last of `libpendula.so.0`. It is raised when a function or a structure of pendula.h changes or
# goes: programs that were linked before would go wrong. What is new does not raise it.
set(PENDULA_C_INTERFACE 0)

# Adds the shared library TARGET of all that is in the static library OF.
function(pendula_add_shared_library target of)
  set(header "${PROJECT_SOURCE_DIR}/src/pendula/pendula.h")
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${header}")
  file(READ "${header}" text)
  string(REGEX REPLACE "/\\*([^*]|\\*[^/])*\\*/" "" text "${text}")
  string(REGEX MATCHALL "pendula_[a-z_]+\\(" functions "${text}")
  list(TRANSFORM functions REPLACE "\\($" "")
  list(JOIN functions "$<SEMICOLON>\n    " functions)
  set(seen "${CMAKE_CURRENT_BINARY_DIR}/pendula.map")
  file(GENERATE OUTPUT "${seen}"
       CONTENT "PENDULA_${PENDULA_C_INTERFACE} {\n  global:\n    ${functions};\n  local:\n    *;\n};\n")

  set(unless_asked EXCLUDE_FROM_ALL)
  if(PENDULA_INSTALL)
    set(unless_asked "")
  endif()
  add_library(${target} SHARED ${unless_asked} "${seen}")
  set_target_properties(${target} PROPERTIES LINKER_LANGUAGE CXX OUTPUT_NAME pendula VERSION "${PENDULA_C_INTERFACE}.${PROJECT_VERSION}"
                                             SOVERSION "${PENDULA_C_INTERFACE}" LINK_DEPENDS "${seen}")
  target_include_directories(${target} INTERFACE "$<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src>")
  target_link_libraries(${target} PRIVATE "$<LINK_LIBRARY:WHOLE_ARCHIVE,${of}>")
  target_link_options(${target} PRIVATE "-Wl,--version-script=${seen}" $<$<NOT:$<BOOL:${PENDULA_CHECKED}>>:-Wl,-z,defs>)
endfunction()
