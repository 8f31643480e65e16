# pirt_embed(TARGET NAMESPACE FILE...): compiles files (text, or binary ones: programs, bitstreams) into TARGET, found by their file name.
#
# Generates <binary dir>/generated/<NAMESPACE>.h with
#   namespace pirt::<NAMESPACE> { std::span<const pirt::EmbeddedFile> files(); }
# No script language but CMake, and no path needed at run time.
set(PIRT_EMBED_SCRIPT ${CMAKE_CURRENT_LIST_DIR}/embed_files.cmake)

function(pirt_embed target name)
  set(out_dir ${CMAKE_BINARY_DIR}/generated)
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
  target_sources(${target} PRIVATE ${out_dir}/${name}.cpp ${out_dir}/${name}.h)
endfunction()
