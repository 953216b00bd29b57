# What the pages of src/view are made of: their own sources and three.js, as constants of a C++ file.
include_guard(GLOBAL)

# Debian and Ubuntu have r111 (package libjs-three), which is what src/view/page/space.js is written for.
find_file(PENDULA_THREE_JS three.min.js PATHS /usr/share/javascript/three /usr/share/nodejs/three/build
          DOC "three.js in its form for any loader (UMD), for pages of motions in space")
if(NOT PENDULA_THREE_JS)
  message(FATAL_ERROR "pendula: three.min.js was not found; install libjs-three (scripts/setup does), or set "
                      "PENDULA_THREE_JS to the file")
endif()

# Sets OUT_SOURCE to a C++ file that defines what view/assets.hpp declares, made again when one of FOLDER's files changes.
function(pendula_page_assets folder out_source)
  set(output "${PROJECT_BINARY_DIR}/view/assets.cpp")
  file(GLOB files CONFIGURE_DEPENDS "${folder}/*")
  add_custom_command(
    OUTPUT "${output}"
    COMMAND "${CMAKE_COMMAND}" -D FOLDER=${folder} -D THREE=${PENDULA_THREE_JS} -D OUTPUT=${output}
            -P "${PROJECT_SOURCE_DIR}/cmake/embed.cmake"
    DEPENDS ${files} "${PENDULA_THREE_JS}" "${PROJECT_SOURCE_DIR}/cmake/embed.cmake"
            "${PROJECT_SOURCE_DIR}/cmake/embed_bytes.cmake"
    COMMENT "Embedding the sources of pages" VERBATIM)
  set(${out_source} "${output}" PARENT_SCOPE)
endfunction()
