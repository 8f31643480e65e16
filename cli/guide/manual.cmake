# Writes the manual pages of PROGRAM into FOLDER; EMULATOR runs it where it is built for another processor.
execute_process(COMMAND ${EMULATOR} ${PROGRAM} manual OUTPUT_VARIABLE names OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
string(REPLACE "\n" ";" names "${names}")
file(REMOVE_RECURSE ${FOLDER})  # pages of commands that are gone
file(MAKE_DIRECTORY ${FOLDER})
find_program(GZIP gzip)
foreach(name IN LISTS names)
  execute_process(COMMAND ${EMULATOR} ${PROGRAM} manual ${name} -o ${FOLDER}/${name}.1 COMMAND_ERROR_IS_FATAL ANY)
  if(GZIP)  # as Debian has them
    execute_process(COMMAND ${GZIP} -9n ${FOLDER}/${name}.1 COMMAND_ERROR_IS_FATAL ANY)
  endif()
endforeach()
