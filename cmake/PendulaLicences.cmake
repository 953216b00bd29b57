# The licences of what is compiled into pendula, as this system's packages state them.
include_guard(GLOBAL)

# Installs each as DESTINATION/NAME; what follows are more arguments of install().
function(pendula_install_licences destination)
  foreach(part IN ITEMS eigen3:libeigen3-dev xsimd:libxsimd-dev hdf5:libhdf5-dev isa-l:libisal-dev
                        random123:librandom123-dev cli11:libcli11-dev tomlplusplus:libtomlplusplus-dev
                        nlohmann-json:nlohmann-json3-dev)
    string(REGEX MATCH "^([^:]*):(.*)$" matched "${part}")
    set(name "${CMAKE_MATCH_1}")
    set(file "/usr/share/doc/${CMAKE_MATCH_2}/copyright")
    if(EXISTS "${file}")
      install(FILES "${file}" DESTINATION "${destination}" RENAME "${name}" ${ARGN})
    endif()
  endforeach()
  install(FILES "${PROJECT_SOURCE_DIR}/src/lab/licences.txt" DESTINATION "${destination}" RENAME laboratory ${ARGN})
endfunction()
