# All that Verilator made in FOLDER as one translation unit, all.cpp: it compiles once, and quickly.
file(GLOB parts RELATIVE ${FOLDER} ${FOLDER}/V*.cpp)
list(SORT parts)
set(text "")
foreach(part IN LISTS parts)
  string(APPEND text "#include \"${part}\"\n")
endforeach()
file(WRITE ${FOLDER}/all.cpp "${text}")
