#!/usr/bin/env bash
# A cluster of Slurm on one machine, for tests: no service manager, no accounting, nothing outside its folder.
#
#   one-box.sh start FOLDER [NODES]   munged, slurmctld and NODES nodes (n1, n2, ...) of one processor each
#   one-box.sh stop FOLDER            ends what start began
#   one-box.sh kill-node FOLDER NODE  ends a node and its jobs at once, as a power cut does
#   one-box.sh node FOLDER NODE       starts a node again
#
# Clients need SLURM_CONF=FOLDER/slurm.conf. The program comes from Debian's packages:
#   apt-get install --no-install-recommends slurmctld slurmd slurm-client slurm-wlm-basic-plugins munge
set -euo pipefail

usage() { sed -n '2,11s/^# \{0,1\}//p' "$0" >&2; exit 2; }
[ $# -ge 2 ] || usage
action=$1 folder=$(realpath -m "$2")
export SLURM_CONF=$folder/slurm.conf

# A key that nobody else has, and a socket of our own: the system's munge is left alone.
start_munge() {
  install -d -m 700 "$folder/munge"
  (umask 077; head -c 128 /dev/urandom >"$folder/munge/key")
  munged --key-file="$folder/munge/key" --seed-file="$folder/munge/seed" --log-file="$folder/log/munged.log" \
    --pid-file="$folder/run/munged.pid" --socket="$folder/run/munge.socket" --num-threads=1
}

configure() {
  local nodes=$1 user port
  user=$(id -un) port=$((30000 + RANDOM % 20000))
  cat >"$SLURM_CONF" <<CONF
ClusterName=onebox
SlurmctldHost=$(hostname)(127.0.0.1)
SlurmUser=$user
SlurmdUser=$user
SlurmctldPort=$port
AuthType=auth/munge
AuthInfo=socket=$folder/run/munge.socket
CredType=cred/munge
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool-%n
SlurmctldPidFile=$folder/run/slurmctld.pid
SlurmdPidFile=$folder/run/slurmd-%n.pid
SlurmctldLogFile=$folder/log/slurmctld.log
SlurmdLogFile=$folder/log/slurmd-%n.log
# Without control groups, memory is not bounded and processes are found by their parents.
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/filetxt
JobCompLoc=$folder/log/jobs.txt
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
MailProg=/bin/true
# A node that went is missed soon, and welcome as soon as it is back.
SlurmdTimeout=5
ReturnToService=2
SchedulerParameters=batch_sched_delay=1,sched_interval=2
NodeName=n[1-$nodes] NodeHostname=$(hostname) NodeAddr=127.0.0.1 Port=[$((port + 1))-$((port + nodes))] CPUs=1 RealMemory=1000
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
}

start_node() { mkdir -p "$folder/spool-$1"; slurmd -N "$1"; }

# Ends a process by its file, and whatever it began.
kill_tree() {
  local child
  for child in $(ps -o pid= --ppid "$1"); do kill_tree "$child"; done
  kill -KILL "$1" 2>/dev/null || true
}

case $action in
start)
  nodes=${3:-2}
  mkdir -p "$folder"/{state,log,run}
  chmod 755 "$folder" "$folder/run"
  start_munge
  configure "$nodes"
  slurmctld
  for i in $(seq "$nodes"); do start_node "n$i"; done
  for _ in $(seq 100); do
    [ "$(sinfo -h -N -t idle -o %N 2>/dev/null | wc -l)" -ge "$nodes" ] && exit 0
    sleep 0.2
  done
  echo "one-box.sh: the nodes did not come up; $folder/log says why" >&2
  exit 1 ;;
stop)
  scancel --user="$(id -un)" 2>/dev/null || true
  for file in "$folder"/run/slurmd-*.pid "$folder"/run/slurmctld.pid "$folder"/run/munged.pid; do
    if [ -f "$file" ]; then kill "$(cat "$file")" 2>/dev/null || true; fi
  done ;;
kill-node)
  node=${3:?}
  # The daemon first, or it would say that its jobs failed; then their shepherds and what those began, which outlive it.
  kill -KILL "$(cat "$folder/run/slurmd-$node.pid")"
  for script in $(pgrep -f "^/bin/bash $folder/spool-$node/job" || true); do
    kill -KILL "$(ps -o ppid= -p "$script" | tr -d ' ')" || true
    kill_tree "$script"
  done ;;
node) start_node "${3:?}" ;;
*) usage ;;
esac
