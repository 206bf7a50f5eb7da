# shellcheck shell=bash disable=SC2154
# Network namespaces, cables, the simulator and both controllers of `play`, which sources this file.
#
#   controller 1                       plant (ringcat sim)                 controller 2
#   c1main ----------------- ring0 [station 1] - [station 2] ring1 ----------------- c2red
#   c1red  ------------------------------------------------------------------------- c2main
#
# Each controller is a namespace. A veth pair is a cable; one end that is switched off is a cut cable.

names=(c1 c2 plant pc)
# Both ends of a pair need different indices: otherwise the kernel reports a lost carrier late.
next_index=50
# Process of each controller, and the bytes of its log that were shown.
pids=("" "" "")
# Not empty: the controller was asked to end.
ending=("" "" "")
shown=(0 0 0)
steps=0
held=0
title="the start"

# fail REASON...: the expectation that did not hold. Ends the script, also out of `$(...)`; the last line is this
# verdict.
fail() {
    [[ -e $files/verdict ]] || echo "$title: $*" >"$files/verdict"
    exit 1
}

# net NAME COMMAND...: `ip` in a namespace of this script.
net() {
    ip -n "$prefix-$1" "${@:2}"
}

# within NAME COMMAND...: the command, in place of this shell, in a namespace of this script.
within() {
    exec ip netns exec "$prefix-$1" "${@:2}"
}

# cable NAME INTERFACE NAME INTERFACE: a veth pair between two namespaces.
cable() {
    net "$1" link add "$2" index "$next_index" type veth peer name "$4" index $((next_index + 50)) netns "$prefix-$3"
    next_index=$((next_index + 1))
    # With addresses of IPv6 the kernel would send frames of its own.
    net "$1" link set "$2" addrgenmode none
    net "$3" link set "$4" addrgenmode none
}

# All that is needed before the first step.
make_topology() {
    local name
    for name in "${names[@]}"; do
        ip netns add "$prefix-$name" || fail "no network namespace can be made"
    done
    cable c1 c1main plant ring0
    cable plant ring1 c2 c2red
    cable c1 c1red c2 c2main
    net plant link set ring0 up
    net plant link set ring1 up
    # Interfaces of controllers stay off: `ringcat standby` switches them on when it forwards.
}

# A computer beside controller 1, which is its router to controller 2.
make_diagnosis_computer() {
    cable pc pc0 c1 office
    net pc addr add 10.0.1.2/24 dev pc0
    net pc link set pc0 up
    net c1 addr add 10.0.1.1/24 dev office
    net c1 link set office up
    net pc route add default via 10.0.1.1
    (within c1 sh -c 'echo 1 > /proc/sys/net/ipv4/ip_forward')
}

# start_simulator: both stations, in a namespace of their own. Orders go to its input, its output comes back.
start_simulator() {
    set -m
    coproc simulator { within plant "$ringcat" sim --main ring0 --redundant ring1 --segment "$here/stations.toml" \
        "${thread[@]}" 2>"$files/plant.errors"; }
    set +m
    # The descriptors of a coprocess are closed in $(...), so copies are made.
    exec {orders}>&"${simulator[1]}" {answers}<&"${simulator[0]}"
    order status >/dev/null
}

# order WORDS...: an order to the simulator; prints its answer.
order() {
    local line
    echo "$*" >&"$orders" || fail "the simulator has ended: $(tail -n 1 "$files/plant.errors")"
    while read -r -t "$limit" -u "$answers" line; do
        case $line in
            ok) return ;;
            error:*) fail "order \"$*\": $line" ;;
            # What happens meanwhile.
            [0-9]*" ms  "*) echo "$line" >>"$files/plant" ;;
            *) echo "$line" ;;
        esac
    done
    fail "the simulator does not answer to \"$*\": $(tail -n 1 "$files/plant.errors")"
}

# start NUMBER OPTION...: the program on this controller.
start() {
    local name=c$1
    set -m
    within "$name" "$ringcat" standby --main "${name}main" --redundant "${name}red" --network "$files/machine.toml" \
        "${role[@]}" "${thread[@]}" "${@:2}" >>"$files/$name" 2>&1 </dev/null &
    set +m
    pids[$1]=$!
    ending[$1]=""
}

# ask_to_end NUMBER: Ctrl-C on this controller. `ask_all_to_end NUMBER`: SIGTERM to the program and its guard, which is
# how systemd stops a service.
ask_to_end() {
    ending[$1]=yes
    kill -INT "${pids[$1]}"
}
ask_all_to_end() {
    local processes
    ending[$1]=yes
    mapfile -t processes < <(ip netns pids "$prefix-c$1")
    kill -TERM "${processes[@]}"
}

# runs NUMBER: whether the controller runs, unless it was not started or asked to end.
runs() {
    [[ -z ${pids[$1]} || -n ${ending[$1]} ]] || ! ended "$1"
}

# ended NUMBER: whether the program on this controller has ended.
ended() {
    ! kill -0 "${pids[$1]}" 2>/dev/null
}

# finish NUMBER STATUS: waits until the controller has ended, and checks its exit status.
finish() {
    local status=0
    await "controller $1 ends" ended "$1"
    wait "${pids[$1]}" 2>/dev/null || status=$?
    pids[$1]=""
    [[ $status == "$2" ]] || fail "controller $1 ended with status $status, expected $2"
}

# strike NUMBER: kills this controller. Waiting at once keeps the shell from printing the signal.
strike() {
    local status=0
    kill -KILL "${pids[$1]}"
    wait "${pids[$1]}" 2>/dev/null || status=$?
    pids[$1]=""
    [[ $status == 137 ]] || fail "controller $1 ended with status $status before it was killed"
}

# The cables: `cut CABLE`, `heal CABLE`.
cut() { switch "$1" down cut; }
heal() { switch "$1" up heal; }
switch() {
    case $1 in
        c1-plant) net plant link set ring0 "$2" ;;
        c2-plant) net plant link set ring1 "$2" ;;
        c1-c2) net c1 link set c1red "$2" ;;
        stations) order "$3" 2-3 >/dev/null ;;
    esac
}

# said NUMBER WORDS: whether the controller has said this since the step began.
said() {
    tail -c "+$((shown[$1] + 1))" "$files/c$1" 2>/dev/null | grep -F -- "$2" >/dev/null
}

# states: the state of each SubDevice, with blanks between.
states() {
    order status | sed -n 's/^.*"[a-z0-9-]*": \([A-Z]*.*\)$/\1/p' | tr '\n' ' '
}

# partner_is_ready NUMBER: whether this controller has last reported that the other one is ready, with all links.
partner_is_ready() {
    [[ $(grep -F "the other MainDevice: " "$files/c$1" | tail -n 1) == *": ready" ]]
}

# no_watchdog_expired: the counter of watchdogs of process data in both terminals with outputs.
no_watchdog_expired() {
    [[ $(order register outputs-1 0x0442 1) == 00 && $(order register outputs-2 0x0442 1) == 00 ]]
}

# is_off NUMBER: both interfaces of this controller are switched off.
is_off() {
    ! net "c$1" -o link show up | grep -E "c$1(main|red)@" >/dev/null
}

# reaches NAME ADDRESS: whether IP passes.
reaches() {
    (within "$1" python3 "$here/ping.py" "$2" 3 2>&1 | sed "s/^/$1: /" >>"$files/pings")
}

# are STATE NUMBER...: whether these SubDevices are in this state.
are() {
    local all number
    read -r -a all <<<"$(states)"
    for number in "${@:2}"; do
        [[ ${all[number]:-} == "$1" ]] || return 1
    done
}

# outputs_of STATION: its outputs in hexadecimal, one bit for each channel; `none` before SAFEOP.
outputs_of() {
    local value
    value=$(order outputs "outputs-$1")
    echo "${value:-none}"
}

# outputs_are STATION HEX: whether the station has these outputs.
outputs_are() {
    [[ $(outputs_of "$1") == "$2" ]]
}

# Outputs are wired to inputs, as in the plant of the manual.
wire() {
    local station value
    for station in 1 2; do
        value=$(outputs_of "$station")
        [[ $value == none ]] || order inputs "inputs-$station" "$value" >/dev/null
    done
}

# await WHAT COMMAND...: waits until the command holds.
await() {
    local until=$((SECONDS + limit))
    while ! "${@:2}"; do
        [[ ! -e $files/verdict ]] || exit 1
        runs 1 || { show; fail "controller 1 has ended, expected: $1"; }
        runs 2 || { show; fail "controller 2 has ended, expected: $1"; }
        ((SECONDS < until)) || { show; fail "not within $limit s: $1"; }
        wire
        sleep 0.05
    done
    held=$((held + 1))
    echo "  holds: $1"
}

# step TITLE: the next step begins.
step() {
    if [[ $steps != 0 ]]; then
        show
        [[ ! -e $files/verdict ]] || exit 1
    fi
    steps=$((steps + 1))
    title="step $steps, $1"
    printf '\n%2d. %s\n' "$steps" "$1"
    [[ -z $pause ]] || read -r -p "  Enter goes on"
}

# show: what both controllers have said since the step began, and what the SubDevices have.
show() {
    local number size
    for number in 1 2; do
        size=$(stat --format %s "$files/c$number" 2>/dev/null || echo 0)
        tail -c "+$((shown[number] + 1))" "$files/c$number" 2>/dev/null | sed "s/^/    controller $number | /"
        shown[number]=$size
    done
    echo "    plant        | $(states)| outputs $(outputs_of 1) and $(outputs_of 2)"
}

# clean_up: removes all that this script has made, and prints the verdict.
clean_up() {
    local name left reason processes=()
    trap '' INT TERM HUP
    # All that runs in namespaces of this script, guards of controllers among it.
    for name in "${names[@]}"; do
        mapfile -t -O "${#processes[@]}" processes < <(ip netns pids "$prefix-$name" 2>/dev/null)
    done
    # A process that was just started may not be in its namespace yet.
    for name in "${pids[@]}" "${simulator_PID:-}"; do
        [[ -z $name ]] || processes+=("$name")
    done
    {
        [[ ${#processes[@]} == 0 ]] || kill -KILL "${processes[@]}"
        wait
    } 2>/dev/null
    for name in "${names[@]}"; do
        ip netns del "$prefix-$name" 2>/dev/null
    done
    left=$(ip netns list | grep -c "^$prefix-")
    reason=$(cat "$files/verdict" 2>/dev/null)
    [[ $left == 0 ]] || reason="${reason:+$reason; }$left network namespaces could not be removed"
    [[ -e $files/whole || -n $reason ]] || reason="$title: the script has ended"
    rm -rf "$files"
    # A signal may have come in a function whose output goes elsewhere.
    exec >&"$output"
    echo
    if [[ -n $reason ]]; then
        echo "result: FAILED: $reason"
        exit 1
    fi
    echo "result: ok: $held expectations held in $steps steps, $SECONDS s"
    exit 0
}
