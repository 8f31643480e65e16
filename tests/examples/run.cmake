# What the scripts of the examples share.

# Ends with what it wrote if it fails. out: what it wrote.
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE failed OUTPUT_VARIABLE out ERROR_VARIABLE out)
  if(failed)
    message(FATAL_ERROR "${ARGN}: ${failed}\n${out}")
  endif()
  set(out "${out}" PARENT_SCOPE)
endfunction()

# Configures the project SOURCE in folder BINARY.
function(configure source binary)
  file(REMOVE_RECURSE ${binary})
  set(flags "")
  if(SANITIZE)
    set(flags "-fsanitize=${SANITIZE}")
  endif()
  run(${CMAKE_COMMAND} -S ${source} -B ${binary} -DCMAKE_CXX_COMPILER=${CXX} -DCMAKE_CXX_FLAGS=${flags} -DCMAKE_BUILD_TYPE=Release ${ARGN})
endfunction()

# Warnings of ours are nobody else's.
function(check_flags binary target)
  file(STRINGS ${binary}/CMakeFiles/${target}.dir/flags.make ours REGEX "-Wconversion|-Werror")
  if(ours)
    message(FATAL_ERROR "our warning flags leak into ${target}: ${ours}")
  endif()
endfunction()

# Each program, named by its folder within BINARY, links once what says where modules are, which Makefiles make before.
function(check_place binary)
  foreach(folder IN LISTS ARGN)
    file(READ ${binary}/${folder}/link.txt link)
    string(REGEX MATCHALL "module_folder\\.cpp\\.o" places "${link}")
    if(NOT places STREQUAL "module_folder.cpp.o")
      message(FATAL_ERROR "a program does not know once where modules are, but '${places}':\n${link}")
    endif()
  endforeach()
  file(STRINGS ${binary}/CMakeFiles/Makefile2 rules REGEX "dir/all: .*pirt_place\\.dir/all")
  if(NOT rules)
    message(FATAL_ERROR "no Makefile waits for what says where modules are")
  endif()
endfunction()

# @param text  Of a link line, or ldd.
function(check_no_kernels text)
  if(text MATCHES "(opencv|dnnl|OpenCL|ceres|sqlite)[^ \n]*")
    message(FATAL_ERROR "pirt::scheduler brings ${CMAKE_MATCH_0}:\n${text}")
  endif()
endfunction()
