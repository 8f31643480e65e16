# Makes OUT, which adds a test PREFIX.SUITE to CTest for each suite of a test PROGRAM. Run when that is built.
execute_process(COMMAND ${PROGRAM} --gtest_list_tests OUTPUT_VARIABLE listed COMMAND_ERROR_IS_FATAL ANY)
string(REGEX MATCHALL "\n[A-Za-z0-9_/]+\\.[ \n]" suites "\n${listed}")  # cases are indented
set(tests "")
foreach(suite IN LISTS suites)
  string(REGEX MATCH "[A-Za-z0-9_/]+" suite "${suite}")
  string(APPEND tests "add_test([=[${PREFIX}.${suite}]=] \"${PROGRAM}\" \"--gtest_filter=${suite}.*\")\n"
    "set_tests_properties([=[${PREFIX}.${suite}]=] PROPERTIES TIMEOUT ${TIMEOUT})\n")
endforeach()
if(NOT tests)
  message(FATAL_ERROR "${PROGRAM} lists no tests:\n${listed}")
endif()
file(WRITE ${OUT} "${tests}")
