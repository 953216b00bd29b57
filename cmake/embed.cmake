# The sources of pages as a C++ file: cmake -D FOLDER=… -D OUTPUT=… -P embed.cmake
cmake_minimum_required(VERSION 3.25)

# Scripts of a page, in the order in which they stand in one module: each knows the names of those before it.
set(before format data motion palette player gestures curves plots shapes view trace stage theatre)
set(after pickers panels marks laboratory controls main)

include("${CMAKE_CURRENT_LIST_DIR}/embed_bytes.cmake")

file(WRITE "${OUTPUT}.new" "// Made by cmake/embed.cmake.\n#include \"view/assets.hpp\"\n\nnamespace pendula::view::assets {\n\n")
embed(page "${FOLDER}/page.html")
embed(style "${FOLDER}/page.css")
embed_scripts(script_before ${before})
embed_scripts(script_plane plane)
embed_scripts(script_space light space)
embed_scripts(script_lanes lanes)
embed_scripts(script_after ${after})
file(APPEND "${OUTPUT}.new" "}  // namespace pendula::view::assets\n")
file(RENAME "${OUTPUT}.new" "${OUTPUT}")
