# Completion of pirt for fish: what may follow is what `pirt complete` says.
function __pirt_complete
    set -l words (commandline -opc)
    set -l typed (commandline -ct)
    for line in (eval $words[1] complete -- (string escape -- $words[2..-1] "$typed") 2>/dev/null)
        switch $line
            case ':files'
                __fish_complete_path (string replace -r '^-[^=]*=' '' -- "$typed")
            case ':*'
            case '*'
                echo $line
        end
    end
end
complete -c pirt -f -a '(__pirt_complete)'
