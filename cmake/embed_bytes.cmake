# Files as constants of a C++ file, ${OUTPUT}.new.

# Appends a constant NAME with the bytes of the files that follow: as numbers, which any compiler takes in any amount.
function(embed name)
  set(bytes "")
  foreach(file IN LISTS ARGN)
    file(READ "${file}" piece HEX)
    string(APPEND bytes "${piece}")
  endforeach()
  string(REGEX REPLACE "(................................)" "\\1\n" bytes "${bytes}")
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "'\\\\x\\1'," bytes "${bytes}")
  file(APPEND "${OUTPUT}.new" "constexpr char ${name}_bytes[] = {\n${bytes}};\n"
                              "const std::string_view ${name}(${name}_bytes, sizeof(${name}_bytes));\n\n")
endfunction()

# Sets OUT to the text of the scripts that follow, without comments and indentation: these are for those who read the sources.
function(read_scripts out)
  set(all "")
  foreach(file IN LISTS ARGN)
    file(READ "${file}" text)
    string(APPEND all "${text}")
  endforeach()
  string(REGEX REPLACE "\n *//[^\n]*" "" all "\n${all}")
  string(REGEX REPLACE "\n +" "\n" all "${all}")
  set(${out} "${all}" PARENT_SCOPE)
endfunction()

# Appends a constant NAME with the text of scripts, by their names in FOLDER.
function(embed_scripts name)
  list(TRANSFORM ARGN PREPEND "${FOLDER}/")
  list(TRANSFORM ARGN APPEND ".js")
  read_scripts(text ${ARGN})
  file(WRITE "${OUTPUT}.js" "${text}")
  embed(${name} "${OUTPUT}.js")
endfunction()
