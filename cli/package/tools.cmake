# Read by cpack: without these it makes no packages of Debian, or ones that depend on nothing.
if(CPACK_GENERATOR STREQUAL "DEB")
  foreach(tool dpkg-shlibdeps file)
    find_program(path_of_${tool} ${tool})
    if(NOT path_of_${tool})
      message(FATAL_ERROR "there is no ${tool}, which packages need: apt-get install dpkg-dev file")
    endif()
  endforeach()
endif()
