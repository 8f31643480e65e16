# The examples in a project that adds pirt's folder: configured, with what that makes of their flags; with -DWHOLE=ON built and run too,
# which takes as long as building pirt.
include(${CMAKE_CURRENT_LIST_DIR}/run.cmake)
set(project ${BUILD}/tests/examples/subdirectory)
configure(${SOURCE}/subdirectory ${project})
check_flags(${project} robot)
check_flags(${project} schedule)
file(READ ${project}/CMakeFiles/schedule.dir/link.txt link)
check_no_kernels("${link}")
if(WHOLE)
  run(${CMAKE_COMMAND} --build ${project} --target robot schedule --parallel 2)
  run(${project}/robot 5)
  run(${project}/schedule)
else()
  # What is generated is found where it was written.
  run(${CMAKE_COMMAND} --build ${project} --target mix_files_embedded)
endif()
