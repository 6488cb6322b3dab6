# SPDX-License-Identifier: BSD-3-Clause
# Sourced by scripts that fetch packages of another architecture from where this
# machine's own apt takes Debian's.
# shellcheck shell=bash

readonly SUITE=bookworm

# SOURCES_FILE:POSITION of each entry of apt's configuration that serves SUITE or SUITE
# with one of these endings.
# shellcheck disable=SC2016  # apt-get expands the $(FIELDS)
debian_entries() {
  apt-get indextargets --format '$(SOURCESENTRY)|$(RELEASE)|$(COMPONENT)|$(ORIGIN)' \
    'Created-By: Packages' |
    awk -F'|' -v suite="^$SUITE($1)?\$" \
      '$2 ~ suite && $3 == "main" && $4 == "Debian" && !seen[$1]++ { print $1 }'
}

# copy_debian_sources DIR [ENDINGS]: copies apt's Debian entries, with their keys and options but without their
# restriction to this machine's architecture, to DIR/debian.list and .sources.
copy_debian_sources() {
  local dir=$1 endings=${2:--updates|-security} entry file position
  rm -f "$dir/debian.list" "$dir/debian.sources"
  debian_entries "$endings" > "$dir/entries"
  while read -r entry; do
    file=${entry%:*}
    position=${entry##*:}
    if [[ $file == *.sources ]]; then
      grep -v '^#' "$file" | awk -v RS= -v n="$position" 'NR == n' |
        grep -viE '^(Architectures|Types):' | sed '1i Types: deb' >> "$dir/debian.sources"
      echo >> "$dir/debian.sources"
    else
      sed -n "${position}p" "$file" | sed -E 's/(\[| )arch=[^] ]*/\1/' >> "$dir/debian.list"
    fi
  done < "$dir/entries"
}

# apt's own way out (proxy, retries, credentials) in apt.conf syntax.
print_apt_options() {
  local netrc netrcparts
  eval "$(apt-config shell netrc Dir::Etc::netrc/f netrcparts Dir::Etc::netrcparts/d)"
  apt-config dump | grep -E '^Acquire::' | grep -vE '^Acquire::(IndexTargets|Changelogs)'
  echo "Dir::Etc::netrc \"$netrc\";"
  echo "Dir::Etc::netrcparts \"$netrcparts\";"
}
