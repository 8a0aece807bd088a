"""`benchmarks/socketcan.py` in a virtual machine with a Debian kernel, which has virtual CAN interfaces.

    apt-get install qemu-system-x86 busybox-static can-utils kmod cpio   # as root
    python benchmarks/socketcan_qemu.py [--kernel linux-image-….deb] [--rows walk motor_silent ...]
    python benchmarks/socketcan_qemu.py --run "benchmarks/bus_load.py --robots go1 --buses socketcan"
    python benchmarks/socketcan_qemu.py --run "-m pytest -p no:cacheprovider tests/deploy/test_socketcan.py"

For machines whose own kernel has no CAN. The kernel is a Debian package; without --kernel the current one is
downloaded by apt-get. The guest's files are this machine's, read-only over 9p, so the same Python and the
same footfall run in it: that benchmark, or the command of --run. Results, candump's logs and the guest's
console are written to --out.

Emulated processors are slow. With `-icount` the guest's clock counts instructions, one per nanosecond: the
guest is a machine with 1,000 million instructions per second whose time runs slower than real time, so its
deadlines stay meaningful. --accel kvm uses the processor's virtualisation if available.
"""

import argparse
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
MODULES = ("virtio_pci", "9pnet_virtio", "9p", "vcan", "can_raw")
BUSES = ("can0", "can1", "can2", "can3")
NEEDED = ("qemu-system-x86_64", "busybox", "depmod", "modprobe", "cpio", "dpkg-deb")

INIT = """#!/bin/busybox sh
/bin/busybox --install -s /bin
mount -t proc proc /proc
mount -t sysfs sys /sys
mount -t devtmpfs dev /dev
{modules}
mount -t 9p -o trans=virtio,version=9p2000.L,msize=1048576,cache=loose,ro root /root
mount -t proc proc /root/proc
mount -t sysfs sys /root/sys
mount -t devtmpfs dev /root/dev
mkdir -p /root/dev/shm
mount -t tmpfs tmpfs /root/dev/shm
mount -t 9p -o trans=virtio,version=9p2000.L,msize=1048576 out /root/mnt
for bus in {buses}; do ip link add $bus type vcan; ip link set $bus up; done
echo "guest: kernel $(uname -r), interfaces: $(ls /sys/class/net | xargs)"
mkdir /root/dev/shm/out
chroot /root /usr/bin/env -i -C {root} {environment} {command}
echo "guest: exit status $?"
cp -r /root/dev/shm/out/. /root/mnt/
sync
poweroff -f
"""


def unpack(package: Path | None, folder: Path) -> tuple[Path, Path, str]:
    """Image of a kernel, the folder with its modules, and its version."""
    if package is None:
        depends = subprocess.run(
            ["apt-cache", "depends", "linux-image-amd64"], capture_output=True, text=True, check=True
        )
        name = next(
            line.split()[-1] for line in depends.stdout.splitlines() if "Depends: linux-image-" in line
        )
        subprocess.run(["apt-get", "download", name], cwd=folder, check=True)
        package = next(folder.glob("linux-image-*.deb"))
    tree = folder / "kernel"
    subprocess.run(["dpkg-deb", "-x", str(package), str(tree)], check=True)
    image = next((tree / "boot").glob("vmlinuz-*"))
    version = image.name.removeprefix("vmlinuz-")
    subprocess.run(["depmod", "-b", str(tree), version], check=True)
    return image, tree, version


def initramfs(tree: Path, version: str, init: str, folder: Path) -> Path:
    """Initial root file system: busybox, the guest's modules, and a script."""
    base = folder / "initramfs"
    for name in ("bin", "proc", "sys", "dev", "root", "modules"):
        (base / name).mkdir(parents=True, exist_ok=True)
    busybox = shutil.which("busybox")
    assert busybox is not None
    shutil.copy(busybox, base / "bin" / "busybox")
    loads: list[str] = []
    for module in MODULES:
        dependencies = subprocess.run(
            ["modprobe", "-d", str(tree), "-S", version, "--show-depends", module],
            capture_output=True,
            text=True,
            check=True,
        )
        for line in dependencies.stdout.splitlines():
            if line.startswith("insmod "):
                file = Path(line.split()[1])
                if f"insmod /modules/{file.name}" not in loads:
                    shutil.copy(file, base / "modules" / file.name)
                    loads.append(f"insmod /modules/{file.name}")
    script = base / "init"
    script.write_text(init.replace("{modules}", "\n".join(loads)))
    script.chmod(0o755)
    archive = folder / "initramfs.cpio"
    names = subprocess.run(["find", ".", "-print0"], cwd=base, capture_output=True, check=True).stdout
    with archive.open("wb") as out:
        subprocess.run(
            ["cpio", "-0", "-o", "-H", "newc", "--quiet"], cwd=base, input=names, stdout=out, check=True
        )
    return archive


def guest_init(arguments: list[str]) -> str:
    """Script of the guest, which runs Python; the part in braces is replaced with the modules."""
    path = os.pathsep.join([str(Path(sys.executable).parent), "/usr/sbin:/usr/bin:/sbin:/bin"])
    environment = {
        "PATH": path,
        "PYTHONPATH": str(ROOT),
        "PYTHONDONTWRITEBYTECODE": "1",
        "OMP_NUM_THREADS": "1",
        "HOME": "/dev/shm",
        "TMPDIR": "/dev/shm",
    }
    return INIT.format(
        modules="{modules}",
        buses=" ".join(BUSES),
        environment=" ".join(f"{key}={shlex.quote(value)}" for key, value in environment.items()),
        command=shlex.join([sys.executable, *arguments]),
        root=shlex.quote(str(ROOT)),
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kernel", type=Path, help="a Debian package linux-image-VERSION-amd64")
    parser.add_argument("--rows", nargs="+", default=[], help="rows of socketcan.py (default: all)")
    parser.add_argument("--policy", default="go1-flat")
    parser.add_argument(
        "--joint-rate", type=float, default=100.0, help="rate of the control loop in the guest, Hz"
    )
    parser.add_argument("--run", help="other arguments for Python, relative to the repository's root")
    parser.add_argument("--accel", default="tcg", choices=("tcg", "kvm"))
    parser.add_argument("--memory", default="3G")
    parser.add_argument("--out", type=Path, default=Path("socketcan_qemu"))
    options = parser.parse_args()
    missing = [name for name in NEEDED if shutil.which(name) is None]
    if missing:
        sys.exit(f"missing: {', '.join(missing)} (installed as in the docstring of this file)")
    options.out.mkdir(parents=True, exist_ok=True)
    arguments = ["benchmarks/socketcan.py", "--out", "/dev/shm/out", "--policy", options.policy]
    arguments += ["--joint-rate", str(options.joint_rate)]
    arguments += ["--slow"] if options.accel == "tcg" else []
    arguments += ["--rows", *options.rows] if options.rows else []
    init = guest_init(shlex.split(options.run) if options.run else arguments)
    with tempfile.TemporaryDirectory() as folder:
        image, tree, version = unpack(options.kernel, Path(folder))
        archive = initramfs(tree, version, init, Path(folder))
        clock = ["-icount", "shift=0,sleep=on"] if options.accel == "tcg" else []
        shares = [("root", "/", ",readonly=on"), ("out", str(options.out.resolve()), "")]
        command = ["qemu-system-x86_64", "-accel", options.accel, "-cpu", "max", "-m", options.memory]
        command += ["-nographic", "-no-reboot", "-nic", "none", *clock]
        command += ["-kernel", str(image), "-initrd", str(archive)]
        command += ["-append", "console=ttyS0 quiet panic=-1 mitigations=off"]
        for tag, path, extra in shares:
            share = f"local,path={path},mount_tag={tag},security_model=none,multidevs=remap{extra}"
            command += ["-virtfs", share]
        console = options.out / "console.log"
        with (
            console.open("w") as log,
            subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True, errors="replace"
            ) as guest,
        ):
            assert guest.stdout is not None
            status = "?"
            for line in guest.stdout:
                log.write(line)
                log.flush()
                if line.startswith(("{", "guest:")) or " s: " in line:
                    print(line.rstrip(), flush=True)
                if line.startswith("guest: exit status"):
                    status = line.split()[-1]
    sys.exit(0 if status == "0" else 1)


if __name__ == "__main__":
    main()
