"""Whether a channel-frequency-class filter has acted on a recording already, as a note to its budget."""

from nineaudit.filtering import note

__all__ = ["note"]
