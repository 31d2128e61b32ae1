"""Extension that registers the drive laws of a device that does not do what it is told, by names.

Named in `SKINWAVE_EXTENSIONS`, it lets scene files have them; nothing here imports it.
"""

from simple_model import DRIVES
from skinwave.inference.drive_laws import LAWS

DRIVES.update({name: law for name, law in LAWS.items() if name not in DRIVES})
