# Completion of pirt for bash, with Debian's bash-completion: what may follow is what `pirt complete` says.
_pirt() {
  local cur words cword kept line rest="" files
  _get_comp_words_by_ref -n =: cur words cword
  kept=${cur%"${cur##*[=:]}"}  # readline replaces only what follows these
  COMPREPLY=()
  while IFS= read -r line; do
    if [[ $line == :* ]]; then
      rest=$line
    else
      line=${line%%$'\t'*}
      COMPREPLY+=("${line#"$kept"}")
    fi
  done < <("${words[0]/#\~/$HOME}" complete -- "${words[@]:1:cword}" 2>/dev/null)
  case $rest in
    :open) compopt -o nospace ;;
    :files)
      compopt -o filenames
      mapfile -t files < <(compgen -f -- "${cur##*=}")
      COMPREPLY+=("${files[@]}")
      ;;
  esac
}
complete -F _pirt pirt
