# The sources of pages as a C++ file: cmake -D FOLDER=… -D THREE=… -D OUTPUT=… -P embed.cmake
cmake_minimum_required(VERSION 3.25)

# Scripts of a page, in the order in which they stand in one module: each knows the names of those before it.
set(before format data motion palette player gestures plots shapes)
set(space three camera bodies impostors fittings trace space)
set(after pickers panels marks laboratory controls main)

include("${CMAKE_CURRENT_LIST_DIR}/embed_bytes.cmake")

file(READ "${THREE}" three)
if(NOT three MATCHES "REVISION *= *[\"']([0-9]+)")
  message(FATAL_ERROR "pendula: expected three.js at ${THREE}, got a file without its REVISION")
endif()
set(version "${CMAKE_MATCH_1}")
unset(three)

file(WRITE "${OUTPUT}.new" "// Made by cmake/embed.cmake.\n#include \"view/assets.hpp\"\n\nnamespace pendula::view::assets {\n\n")
embed(page "${FOLDER}/page.html")
embed(style "${FOLDER}/page.css")
scripts(files ${before})
embed(script_before ${files})
scripts(files ${after})
embed(script_after ${files})
embed(script_plane "${FOLDER}/plane.js")
scripts(files ${space})
embed(script_space ${files})
embed(script_lanes "${FOLDER}/lanes.js")
file(ARCHIVE_CREATE OUTPUT "${OUTPUT}.gz" PATHS "${THREE}" FORMAT raw COMPRESSION GZip COMPRESSION_LEVEL 9
     MTIME "1970-01-01 00:00:00 UTC")
embed(three "${OUTPUT}.gz")
embed(three_licence "${FOLDER}/three.licence.txt")
file(APPEND "${OUTPUT}.new" "const std::string_view three_version = \"${version}\";\n\n}  // namespace pendula::view::assets\n")
file(RENAME "${OUTPUT}.new" "${OUTPUT}")
