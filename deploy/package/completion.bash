# Completes taclink's commands and options from its own help.
_taclink() {
  local word=${COMP_WORDS[COMP_CWORD]} command=() help
  local i
  for ((i = 1; i < COMP_CWORD; i++)); do
    case ${COMP_WORDS[i]} in
      -*) ;;
      *)
        # Arguments that are no commands end the chain.
        taclink "${command[@]}" --help 2>/dev/null | sed -n '/^Subcommands:/,$p' |
          grep -qE "^  ${COMP_WORDS[i]}( |\$)" || break
        command+=("${COMP_WORDS[i]}")
        ;;
    esac
  done
  help=$(taclink "${command[@]}" --help 2>/dev/null) || return
  if [[ $word == -* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$(grep -oE -- '(^|[ ,])--[a-z0-9-]+' <<<"$help" | tr -d ' ,')" -- "$word")
    return
  fi
  local commands
  commands=$(sed -n '/^Subcommands:/,$s/^  \([a-z][a-z-]*\).*/\1/p' <<<"$help")
  if [ -n "$commands" ]; then
    mapfile -t COMPREPLY < <(compgen -W "$commands" -- "$word")
  else
    mapfile -t COMPREPLY < <(compgen -f -- "$word")
  fi
}
complete -o filenames -F _taclink taclink
