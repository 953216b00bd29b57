# What the pages of src/view are made of, their sources, as constants of a C++ file.
include_guard(GLOBAL)

# Sets OUT_SOURCE to a C++ file that defines what view/assets.hpp declares, made again when one of FOLDER's files changes.
function(pendula_page_assets folder out_source)
  set(output "${PROJECT_BINARY_DIR}/view/assets.cpp")
  file(GLOB files CONFIGURE_DEPENDS "${folder}/*")
  add_custom_command(
    OUTPUT "${output}"
    COMMAND "${CMAKE_COMMAND}" -D FOLDER=${folder} -D OUTPUT=${output}
            -P "${PROJECT_SOURCE_DIR}/cmake/embed.cmake"
    DEPENDS ${files} "${PROJECT_SOURCE_DIR}/cmake/embed.cmake" "${PROJECT_SOURCE_DIR}/cmake/embed_bytes.cmake"
    COMMENT "Embedding the sources of pages" VERBATIM)
  set(${out_source} "${output}" PARENT_SCOPE)
endfunction()
