"""Ends with 0 where programs of cyclonedds hear each other on this machine's loopback, by UDP without multicast.

    python probe.py [DOMAIN]

The other one is this program, too; between them is an image, as in the tests.
"""

import os
import subprocess
import sys
import time

os.environ["CYCLONEDDS_URI"] = (
    '<CycloneDDS><Domain Id="any"><General><Interfaces><NetworkInterface address="127.0.0.1" multicast="false"/>'
    "</Interfaces><AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto"
    '</ParticipantIndex><MaxAutoParticipantIndex>20</MaxAutoParticipantIndex><Peers><Peer address="127.0.0.1"/>'
    "</Peers></Discovery></Domain></CycloneDDS>"
)
PATIENCE_S = 60.0


def speak(domain):
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.topic import Topic

    import camera
    import messages

    participant = DomainParticipant(domain)
    writer = DataWriter(participant, Topic(participant, "rt/probe", messages.Image), qos=messages.RELIABLE)
    image = messages.of(messages.Image, camera.image(0, 160, 120, "rgb8", bytes(3 * 160 * 120)))
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        writer.write(image)
        time.sleep(0.2)


def hear(domain):
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic

    import messages

    participant = DomainParticipant(domain)
    reader = DataReader(participant, Topic(participant, "rt/probe", messages.Image), qos=messages.RELIABLE)
    speaker = subprocess.Popen([sys.executable, __file__, str(domain), "speak"])
    try:
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            if any(isinstance(sample, messages.Raw) for sample in reader.take(N=10)):
                return True
            time.sleep(0.05)
        return False
    finally:
        speaker.kill()
        speaker.wait()


if __name__ == "__main__":
    chosen = int(sys.argv[1]) if len(sys.argv) > 1 else 1 + os.getpid() % 100
    if sys.argv[2:] == ["speak"]:
        speak(chosen)
    else:
        sys.exit(0 if hear(chosen) else 1)
