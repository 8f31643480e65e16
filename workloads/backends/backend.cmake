# pirt_optional_backend(NAME MISSING): a backend that a build may be without. MISSING says in one line what is not there and which package
# brings it; empty = it is built. Sets <NAME>_missing for the caller's directory and, where something is missing, compiles in place of the
# backend one that says so wherever it is asked for (missing_backend.h).
function(pirt_optional_backend name missing)
  set_property(GLOBAL PROPERTY pirt_missing_${name} "${missing}")
  set_property(GLOBAL APPEND PROPERTY pirt_optional_backends ${name})
  if(missing)
    message(STATUS "Backend ${name}: ${missing}")
    configure_file(${PROJECT_SOURCE_DIR}/workloads/backends/missing_backend.cpp.in ${PROJECT_BINARY_DIR}/generated/${name}_missing.cpp @ONLY)
    target_sources(pirt_workloads PRIVATE ${PROJECT_BINARY_DIR}/generated/${name}_missing.cpp)
  endif()
endfunction()
