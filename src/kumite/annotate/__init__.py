"""What happens in the clips: foot contacts and effective hits, found without hand work."""

from kumite.annotate.contacts import Contacts, find_contacts
from kumite.annotate.strikes import Strikes, find_strikes

__all__ = ["Contacts", "Strikes", "find_contacts", "find_strikes"]
