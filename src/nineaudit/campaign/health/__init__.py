"""Which sensor is going bad? What the recordings of a campaign say together of each sensor, by its serial number.

identity.py   which recordings, sensors and rigs count             anchors.py   against what their errors are
records.py    entries of the lake -> likelihoods in order of time
connect.py    likelihoods by what connects them
model.py      the hierarchical model: sensors, seats, tests        scatter.py   how much tests differ
crowd.py      unknowns of the same recordings, in order of time    shapes.py    how they may change
look.py       what is seen of further changes                      border.py    a change more or less
scan.py       changes with time and shock history                  select.py    which of them there are
standing.py   against the rig files in force                       deviations.py   what changed, and whose it may be
assess.py     verdicts        words.py    text and JSON            page.py      charts
rig_file.py   the improved calibration as a rig file
"""

from nineaudit.campaign.health.assess import Health, Member, State, assess

__all__ = ["Health", "Member", "State", "assess"]
