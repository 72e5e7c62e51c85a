# What of a part that is built apart can be had here; for other scripts, by `source`.

# Whether this compiler is new enough for the manifest $1 and its crates are here; else says what is skipped.
# Ends the script where the lock file does not fit the workspace any more.
can_be_built() {
    local manifest=$1 needed found words
    needed=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' "$manifest")
    found=$(rustc --version | sed 's/^rustc \([0-9.]*\).*/\1/')
    if [ "$(printf '%s\n' "$needed" "$found" | sort -V | head -n 1)" != "$needed" ]; then
        echo "skipped: $manifest: rustc $found, it needs $needed"
        return 1
    fi
    words=$(cargo fetch --locked --manifest-path "$manifest" 2>&1) && return
    case $words in
    *--locked*) echo "$words" >&2 && exit 1 ;;
    esac
    echo "skipped: $manifest: its crates cannot be fetched: ${words##*$'\n'}"
    return 1
}
