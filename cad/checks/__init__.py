"""What a scanner's parts are checked for before anybody prints them; one file per concept."""
