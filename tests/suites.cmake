# Makes OUT, which adds a test PREFIX.SUITE to CTest for each suite of a test PROGRAM. Run when that is built. EMULATOR runs it where it is
# built for another processor.
execute_process(COMMAND ${EMULATOR} ${PROGRAM} --gtest_list_tests OUTPUT_VARIABLE listed COMMAND_ERROR_IS_FATAL ANY)
string(REGEX MATCHALL "\n[A-Za-z0-9_/]+\\.[ \n]" suites "\n${listed}")  # cases are indented
set(tests "")
set(command "")
foreach(word IN LISTS EMULATOR PROGRAM)
  string(APPEND command " \"${word}\"")
endforeach()
foreach(suite IN LISTS suites)
  string(REGEX MATCH "[A-Za-z0-9_/]+" suite "${suite}")
  string(APPEND tests "add_test([=[${PREFIX}.${suite}]=]${command} \"--gtest_filter=${suite}.*\")\n"
    "set_tests_properties([=[${PREFIX}.${suite}]=] PROPERTIES TIMEOUT ${TIMEOUT})\n")
endforeach()
if(NOT tests)
  message(FATAL_ERROR "${PROGRAM} lists no tests:\n${listed}")
endif()
file(WRITE ${OUT} "${tests}")
