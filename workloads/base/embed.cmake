# pirt_embed(TARGET NAMESPACE FILE...): compiles files (text, or binary ones: programs, bitstreams) into TARGET, found by their file name.
#
# Generates <binary dir>/generated/<NAMESPACE>.h with
#   namespace pirt::<NAMESPACE> { std::span<const pirt::EmbeddedFile> files(); }
# No script language but CMake, and no path needed at run time.
set(PIRT_EMBED_SCRIPT ${CMAKE_CURRENT_LIST_DIR}/embed_files.cmake)

function(pirt_embed target name)
  set(out_dir ${PROJECT_BINARY_DIR}/generated)
  set(files)
  foreach(file IN LISTS ARGN)
    get_filename_component(path ${file} ABSOLUTE)
    list(APPEND files ${path})
  endforeach()
  string(REPLACE ";" "|" joined "${files}")
  add_custom_command(
    OUTPUT ${out_dir}/${name}.cpp ${out_dir}/${name}.h
    COMMAND ${CMAKE_COMMAND} -DNAME=${name} "-DFILES=${joined}" -DOUT_DIR=${out_dir} -P ${PIRT_EMBED_SCRIPT}
    DEPENDS ${files} ${PIRT_EMBED_SCRIPT}
    COMMENT "Embedding ${name}"
    VERBATIM)
  # The target may be of another folder, where nothing else says that these are made before it.
  set(made ${out_dir}/${name}.cpp ${out_dir}/${name}.h)
  set_source_files_properties(${made} TARGET_DIRECTORY ${target} PROPERTIES GENERATED TRUE)
  target_sources(${target} PRIVATE ${made})
  add_custom_target(${name}_embedded DEPENDS ${made})
  add_dependencies(${target} ${name}_embedded)
endfunction()
